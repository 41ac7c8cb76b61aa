"""The world of full-scene replay: an encounter among all logged cars of its recording, in SUMO."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import DECIMALS
from merge_cosim.core.units import DT, TOLERANCE, FloatArray, IntArray
from merge_cosim.ngsim.pairing.recordings import LoggedScene, PairInScene
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.ramps.view import view_options
from merge_cosim.scoring.surroundings import AROUND
from merge_cosim.simulation.worlds.base import Ended, GivenWorld
from merge_cosim.simulation.worlds.logged_rules import FullScene
from merge_cosim.simulation.worlds.logged_traffic import LoggedTraffic, logged_road
from merge_cosim.simulation.worlds.neighbours import SIGHT, InLane, Neighbours
from merge_cosim.simulation.worlds.tiles import COLORS
from merge_cosim.sumo.options import LOGGED, SumoOptions, delay_option
from merge_cosim.sumo.start import open_session

Place = tuple[LoggedScene, PairInScene]
"""The scene of an encounter, and where the encounter lies in it."""


class LoggedWorld(GivenWorld):
    """One slot: the encounter's two cars drive in SUMO among all cars of the recording.

    The merging car is driven by its log in the scene, which has the stations of the encounter's log; past its end it
    is driven as commanded, which is at its last speed. Each encounter is a SUMO simulation of its own.

    Attributes:
        facts: By case, of each encounter that is over: `cars` in the net at its start, and `released`, `blocked`,
            `driven_through`, `other_contacts` (of released cars with others); with `notes`, a line each.
    """

    channels = AROUND

    def __init__(
        self,
        ramp: Ramp,
        places: Sequence[Place],
        rules: FullScene,
        seed: int = 0,
        gui_delay: int | None = None,
        extra: tuple[str, ...] = (),
    ) -> None:
        """Prepare scenes.

        Args:
            ramp: The ramp of their site.
            places: The scene of each of the n encounters.
            rules: How the other cars take part.
            seed: SUMO's seed.
            gui_delay: Milliseconds per step in sumo-gui, which follows the host; None runs without a window.
            extra: Further options of SUMO.
        """
        super().__init__(1)
        self.step_s, self.vehicle_steps = 0.0, 0
        self.facts: dict[int, dict[str, Any]] = {}
        self._ramp, self._places, self._rules = ramp, places, rules
        self._road, self.shown = logged_road(ramp), gui_delay is not None
        self._folder = tempfile.TemporaryDirectory(prefix="merge-cosim-")
        types = Path(self._folder.name) / "types.add.xml"
        rules.drivers.write(types)
        window = () if gui_delay is None else (*view_options(ramp.net.parent), *delay_option(gui_delay))
        self._options = SumoOptions(ramp.net, seed, ("--additional-files", str(types), *window, *extra), LOGGED)
        self._traffic: LoggedTraffic | None = None
        self._state = np.zeros((4, 1))
        self._around = np.zeros((len(AROUND), 1))
        self._leader = np.zeros((2, 1))

    def place(self, slots: IntArray, cases: IntArray) -> FloatArray:
        """See `GivenWorld`; starts the encounter's simulation, with all cars that are logged in its cycle 0."""
        encounters, case = self.encounters, int(cases[0])
        log = encounters.log
        assert log is not None
        scene, pair = self._places[case]
        self._pair, self._age, self._start = pair, 0, pair.start
        self._merge_position = float(encounters.merge_position[case])
        self._host_log, self._merging_log = log.host_station[case], log.merging_station[case]
        self._takes_over = round(min(self._rules.take_over / DT, len(self._host_log) - 1))
        self._lengths = dict(zip(scene.car.tolist(), scene.length.tolist(), strict=True))
        self._host_lane = scene.host_lane
        self._neighbours = Neighbours(self._lengths[pair.host], SIGHT)
        self._others_touched: set[tuple[str, ...]] = set()
        self._session = open_session(self._options, self.shown)
        self._traffic = LoggedTraffic(self._session, scene, self._ramp, self._rules.drivers)
        self._traffic.advance(pair.start)
        self._simulate()
        self._cars = self._session.vehicle_count()
        self._traffic.take_over(pair.host)
        self._session.stay_on(pair.host, self._ramp.main_route)  # whatever lane its log has
        for car, color in zip((pair.host, pair.merging), COLORS, strict=True):
            self._session.set_color(car, color)
        if self.shown:
            self._session.follow(pair.host)
        shown, given = self._read(), encounters.start[:2, case]
        if not np.allclose(shown, given, rtol=0, atol=TOLERANCE):
            raise RuntimeError(f"{encounters.case[case]}: starts at {given}, its scene has the cars at {shown}")
        self._state[:, 0] = *shown, *encounters.start[2:4, case]
        return self._around.copy()

    def show(self, log_odds: FloatArray) -> None:
        """See `World`."""
        self._session.show(self._pair.host, float(log_odds[0]))

    def command(self, speeds: FloatArray) -> None:
        """See `World`; before the take-over the host drives as it was logged."""
        assert self._traffic is not None
        host, merging = self._pair.host, self._pair.merging
        if self._age >= self._takes_over and self._rules.others == "released":
            self._traffic.release_near(host, self._rules.ahead, self._rules.behind, keep=(merging,))
        if self._age == len(self._merging_log) - 1:
            self._traffic.take_over(merging)
        if self._age < self._takes_over:
            speeds[0, 0] = max(float(self._host_log[self._age + 1] - self._host_log[self._age]) / DT, 0.0)
        self._age += 1
        self._traffic.advance(self._start + self._age)
        self._session.set_speed(host, float(speeds[0, 0]))
        if self._age >= len(self._merging_log):
            self._session.set_speed(merging, float(speeds[1, 0]))

    def step(self) -> None:
        """See `World`."""
        self._simulate()
        station = self._read()
        self._state[2:, 0] = (station - self._state[:2, 0]) / DT
        self._state[:2, 0] = station
        self.collided |= self._touch()

    def observe(self, state: FloatArray, around: FloatArray) -> None:
        """See `World`."""
        self._state.round(DECIMALS, out=state)
        around[:] = self._around

    @property
    def leader(self) -> FloatArray | None:
        """See `World`; None where the host does not heed its leader."""
        return self._leader if self._rules.heed_leader else None

    def ended(self, over: IntArray, age: IntArray) -> Ended | None:
        """See `World`; ends the encounter's simulation."""
        if len(over):
            self._check_lane()
            self.end_scene()
        return super().ended(over, age)

    def close(self) -> None:
        """See `World`."""
        if self._traffic is not None:
            self._session.close()
        self._folder.cleanup()

    def end_scene(self) -> None:
        """Sum up the present encounter and end its simulation."""
        assert self._traffic is not None
        through = self._neighbours.through
        notes = [("driven_through", f"logged car {name} drove into host {self._pair.host}") for name in through]
        notes += [("blocked", f"logged car {name} did not come in: no room") for name in self._traffic.blocked]
        touched = sorted(self._others_touched)
        notes += [("other_contacts", f"SUMO reports a contact of {one} and {other}") for one, other in touched]
        counts = {"released": len(self._traffic.released), "blocked": len(self._traffic.blocked)}
        counts |= {"driven_through": len(through), "other_contacts": len(touched)}
        self.facts[int(self._case[0])] = {"cars": self._cars, **counts, "notes": notes}
        self._traffic = None
        self._session.close()

    def _check_lane(self) -> None:
        """Note a host that is off its lane; the merging car's log may lead anywhere."""
        strip = self._road.at(self._session.lane(self._pair.host))
        if strip is None or strip.lane != self._host_lane:
            self.breaks("lane", np.array([0]))

    def _simulate(self) -> None:
        begin = perf_counter()
        self._session.step()
        self.step_s += perf_counter() - begin

    def _read(self) -> FloatArray:
        """Take in where all cars are, and return the stations of the encounter's two [m]."""
        session, x, in_lane = self._session, {}, []
        names = session.vehicles()
        for name in names:
            strip = self._road.at(session.lane(name))
            if strip is not None:
                x[name] = strip.start + session.lane_position(name)
                if strip.lane == self._host_lane and name not in (self._pair.host, self._pair.merging):
                    in_lane.append(InLane(name, x[name], self._lengths[name]))
        self.vehicle_steps = (self.vehicle_steps or 0) + len(names)
        for name in {self._pair.host, self._pair.merging} - x.keys():
            raise UserError(
                f"{self._ramp.net}: case {self.encounters.case[self._case[0]]}: car {name} has left the ramp's lanes "
                f"before the case was over; lower test.horizon or test.time_out"
            )
        neighbours = self._neighbours
        neighbours.look(x[self._pair.host], in_lane)
        leader_speed = session.speed(neighbours.leader) if neighbours.leader else 0.0
        closing = session.speed(self._pair.host) - leader_speed
        self._leader[:, 0] = neighbours.leader_gap if neighbours.leader else math.inf, leader_speed
        self._around[:, 0] = neighbours.leader_gap, closing, neighbours.follower_gap
        return np.array([x[self._pair.host], x[self._pair.merging]]) - self._merge_position

    def _touch(self) -> bool:
        """Whether SUMO reports a contact of the encounter's two cars; those of released cars with others are noted."""
        pairs = {(contact.one, contact.other) for contact in self._session.contacts()}
        if not pairs:
            return False
        assert self._traffic is not None
        host, released = self._pair.host, set(self._traffic.released)
        self._others_touched |= {pair for pair in pairs if released & set(pair) and host not in pair}
        return tuple(sorted((host, self._pair.merging))) in pairs
