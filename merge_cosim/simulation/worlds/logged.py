"""A world for full-scene replay: an encounter of the pair tests among all logged cars of its recording."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.base import Controller
from merge_cosim.controllers.law import FollowingLaw
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.units import DT, TOLERANCE, BoolArray, FloatArray, IntArray
from merge_cosim.ngsim.pairing.recordings import LoggedScene, PairInScene
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.ramps.view import view_options
from merge_cosim.scoring.surroundings import SIGHT, InLane, Neighbours
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.worlds.logged_rules import FullScene
from merge_cosim.simulation.worlds.logged_traffic import LoggedTraffic, logged_road
from merge_cosim.simulation.worlds.tiles import COLORS
from merge_cosim.sumo.options import LOGGED, SumoOptions, delay_option
from merge_cosim.sumo.start import open_session

Place = tuple[LoggedScene, PairInScene]
"""The scene of an encounter, and where the encounter lies in it."""


AROUND = ("min_leader_gap_m", "min_leader_ttc_s", "min_follower_gap_m")
"""What is kept of each encounter: the smallest gaps to the cars ahead and behind other than the merging car, and the
smallest time to collision with the one ahead; inf without such a car."""


class LoggedWorld:
    """A world (see `World`) of one tile: the encounter's two cars drive in SUMO among all cars of the recording.

    The merging car is driven by its log in the scene, which has the stations of the encounter's log; past its end it is
    driven as commanded, which is at its last speed. Each encounter is a SUMO simulation of its own.

    Attributes:
        around: `AROUND`, shape (n,) each.
        facts: By case, of each encounter that is over: `cars` in the net at its start, and `released`, `blocked`,
            `driven_through`, `other_contacts` (of released cars with others); with `notes`, a line each.
        vehicle_steps: Cars times steps.
    """

    count = 1

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
        self.step_s, self.vehicle_steps = 0.0, 0
        self.state = np.zeros((4, 1))
        self.collided = np.zeros(1, dtype=bool)
        self.around = {name: np.full(len(places), np.inf) for name in AROUND}
        self.facts: dict[int, dict[str, Any]] = {}
        self._ramp, self._places, self._rules = ramp, places, rules
        self._road, self._gui = logged_road(ramp), gui_delay is not None
        self._folder = tempfile.TemporaryDirectory(prefix="merge-cosim-")
        types = Path(self._folder.name) / "types.add.xml"
        rules.drivers.write(types)
        window = () if gui_delay is None else (*view_options(ramp.net.parent), *delay_option(gui_delay))
        self._options = SumoOptions(ramp.net, seed, ("--additional-files", str(types), *window, *extra), LOGGED)
        self._traffic: LoggedTraffic | None = None

    def place(self, tiles: IntArray, encounters: Encounters, cases: IntArray) -> None:
        """See `World`; starts the encounter's simulation, with all cars that are logged in its cycle 0."""
        self._end()
        log, case = encounters.log, int(cases[0])
        assert log is not None
        scene, pair = self._places[case]
        self._case, self._pair, self._age, self._start = case, pair, 0, pair.start
        self._merge_position = float(encounters.merge_position[case])
        self._host_log, self._merging_log = log.host_station[case], log.merging_station[case]
        self._takes_over = round(min(self._rules.take_over / DT, len(self._host_log) - 1))
        self._lengths = dict(zip(scene.car.tolist(), scene.length.tolist(), strict=True))
        self._host_lane = scene.host_lane
        self.neighbours = Neighbours(self._lengths[pair.host], SIGHT)
        self.leader_speed = 0.0
        self._others_touched: set[tuple[str, ...]] = set()
        self._session = open_session(self._options, self._gui)
        self._traffic = LoggedTraffic(self._session, scene, self._ramp, self._rules.drivers)
        self._traffic.advance(pair.start)
        self._step()
        self._cars = self._session.vehicle_count()
        self._traffic.take_over(pair.host)
        self._session.stay_on(pair.host, self._ramp.main_route)  # wherever its log leads
        for car, color in zip((pair.host, pair.merging), COLORS, strict=True):
            self._session.set_color(car, color)
        if self._gui:
            self._session.follow(pair.host)
        shown, given = self._read(), encounters.start[:2, case]
        if not np.allclose(shown, given, rtol=0, atol=TOLERANCE):
            raise RuntimeError(f"{encounters.case[case]}: starts at {given}, its scene has the cars at {shown}")
        self.state[:, 0] = *shown, *encounters.start[2:4, case]
        self.collided[0] = False

    def advance(self, speeds: FloatArray) -> None:
        """See `World`."""
        assert self._traffic is not None
        host, merging = self._pair.host, self._pair.merging
        if self._age >= self._takes_over and self._rules.others == "released":
            self._traffic.release_near(host, self._rules.ahead, self._rules.behind, keep=(merging,))
        if self._age == len(self._merging_log) - 1:
            self._traffic.take_over(merging)
        self._age += 1
        self._traffic.advance(self._start + self._age)
        self._session.set_speed(host, float(speeds[0, 0]))
        if self._age >= len(self._merging_log):
            self._session.set_speed(merging, float(speeds[1, 0]))
        self._step()
        station = self._read()
        self.state[2:, 0] = (station - self.state[:2, 0]) / DT
        self.state[:2, 0] = station
        self.collided |= self._touch()

    @property
    def logged_speed(self) -> float | None:
        """The speed [m/s] of the human host up to the next cycle; None once the method drives."""
        if self._age >= self._takes_over:
            return None
        return float(self._host_log[self._age + 1] - self._host_log[self._age]) / DT

    def among(self, driver: HostDriver) -> HostDriver:
        """A method that drives in this world: with a leader, and from the take-over on."""
        return HostDriver(driver.estimator, _Among(driver.controller, self, self._rules.heed_leader))

    def close(self) -> None:
        """End the simulation."""
        self._end()
        self._folder.cleanup()

    def _end(self) -> None:
        """Sum up the present encounter and end its simulation."""
        if self._traffic is None:
            return
        through = self.neighbours.through
        notes = [("driven_through", f"logged car {name} drove into host {self._pair.host}") for name in through]
        notes += [("blocked", f"logged car {name} did not come in: no room") for name in self._traffic.blocked]
        touched = sorted(self._others_touched)
        notes += [("other_contacts", f"SUMO reports a contact of {one} and {other}") for one, other in touched]
        counts = {"released": len(self._traffic.released), "blocked": len(self._traffic.blocked)}
        counts |= {"driven_through": len(through), "other_contacts": len(touched)}
        self.facts[self._case] = {"cars": self._cars, **counts, "notes": notes}
        self._traffic = None
        self._session.close()

    def _step(self) -> None:
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
        self.vehicle_steps += len(names)
        self.neighbours.look(x[self._pair.host], in_lane)
        leader = self.neighbours.leader
        self.leader_speed = session.speed(leader) if leader else 0.0
        closing = session.speed(self._pair.host) - self.leader_speed
        gap = self.neighbours.leader_gap
        time = max(gap, 0.0) / closing if leader and closing > 0 else math.inf
        for name, value in zip(AROUND, (gap, time, self.neighbours.follower_gap), strict=True):
            self.around[name][self._case] = min(self.around[name][self._case], value)
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


class _Among(Controller):
    """A controller in a scene: it keeps to the log until the take-over.

    From then on it keeps to the smaller of the method's acceleration and that of keeping distance to the leader.
    """

    def __init__(self, inner: Controller, world: LoggedWorld, heed_leader: bool) -> None:
        self._inner, self._world, self._heed_leader = inner, world, heed_leader
        self._law: FollowingLaw = inner if isinstance(inner, FollowingLaw) else Acc()

    def start(self, count: int, setting: Setting) -> None:
        super().start(count, setting)
        self._inner.start(count, setting)

    def reset(self, rows: IntArray) -> None:
        self._inner.reset(rows)

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        wanted = self._inner.command(seen, log_odds, target)
        logged, neighbours = self._world.logged_speed, self._world.neighbours
        if logged is not None:
            return (logged - seen.host_speed) / self.setting.dt
        if self._heed_leader and neighbours.leader:
            gap, speed = np.array([neighbours.leader_gap]), np.array([self._world.leader_speed])
            wanted = np.minimum(wanted, self._law.clip(self._law.follow(gap, seen.host_speed, speed)))
        return wanted
