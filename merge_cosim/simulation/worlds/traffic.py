"""The world of living traffic: SUMO's models drive all cars but the hosts, and encounters begin and end on the way."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from time import perf_counter

import numpy as np

from merge_cosim.core.encounter import NEVER, Encounters, Intention
from merge_cosim.core.observation import Setting
from merge_cosim.core.random_streams import stream_keys
from merge_cosim.core.units import TOLERANCE, AnyArray, FloatArray, IntArray
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scoring.rules import Rules
from merge_cosim.scoring.surroundings import AROUND
from merge_cosim.scoring.tracks import HOST_STATION, MERGING_STATION, RECORDED
from merge_cosim.simulation.leader import LeaderRule
from merge_cosim.simulation.worlds.actors import Actor, Actors
from merge_cosim.simulation.worlds.base import Begun, Ended, World
from merge_cosim.simulation.worlds.meetings import DEFAULT_ATTENTION, STANDING, Attention, Meeting
from merge_cosim.simulation.worlds.neighbours import SIGHT
from merge_cosim.simulation.worlds.notes import Event, Notes
from merge_cosim.sumo.lane_map import LaneMap, Part
from merge_cosim.sumo.session import Session

TRAFFIC = "traffic"
"""The source of encounters in living traffic. What a host does there changes all that follows, so that two methods have
no cases in common."""
BLOCK = 32
"""Slots that are added at a time."""
LEAST_STATES = 2
"""A meeting that is to be scored has been seen to move."""
LATE = 1.0
"""A vehicle that is to depart in the last second of a scene may not have come in [s]."""
_NO_DEPARTURES: Mapping[str, float] = {}
_NOBODY = np.array([-1e3, -1e3, 10.0, 10.0])
"""State of a slot without a meeting: far away, and finite."""
_X = ("host_x_m", "merging_x_m")


class TrafficWorld(World):
    """Hosts among cars that SUMO drives.

    Every (host, merging car) in each other's sight is a *meeting* and has a slot. A host drives by the smallest of the
    speeds commanded for its meetings, free driving, and the law of following its leader in the lane.

    Where a car will merge is not known before it does: station 0 is the ramp's usual merging point, and once the car is
    past it, just ahead of it; from the lane change on it is where it changed.

    Attributes:
        notes: What went on that the user should know of.
        meetings: Number of meetings that have ended.
        stopped: Of them, those whose merging car stood before it could merge.
        kept: The meetings that are scored, in the order of their end: the car merged next to the host.
    """

    channels = (*_X, *AROUND)

    def __init__(
        self,
        session: Session,
        ramp: Ramp,
        scene: str = "000",
        end: float = math.inf,
        warm_up: float = 0.0,
        host: str = "",
        attention: Attention = DEFAULT_ATTENTION,
    ) -> None:
        """Drive the hosts of a running SUMO.

        Args:
            session: The running SUMO.
            ramp: The ramp whose net, or copies of it, is loaded.
            scene: Name of the scene, which begins the names of its encounters.
            end: When it ends [s]; inf for when the last car has left.
            warm_up: The throughput is counted from here on [s].
            host: A vehicle, flow or type that is a host without saying so.
            attention: Which merging cars a host attends to.
        """
        self.session, self._ramp, self._scene, self._attention = session, ramp, scene, attention
        self._end, self._warm_up = end, warm_up
        self._actors = Actors(session, LaneMap(ramp), host)
        self.slots = BLOCK
        self._by_slot: dict[int, Meeting] = {}
        self._gone: list[Meeting] = []
        self._met: dict[str, set[str]] = {}
        self._state = np.tile(_NOBODY[:, None], BLOCK)
        self._around = np.zeros((len(self.channels), BLOCK))
        self._ahead: dict[str, tuple[float, float]] = {}
        self._driven: list[Actor] = []
        self._cycle = -1
        self._teleports = self._teleported()
        self.begun_at = self.time = session.time()
        self.arrived, self.vehicle_steps = 0, 0
        self.step_s = 0.0
        self.meetings = self.stopped = 0
        self.kept: list[Meeting] = []
        self.notes = Notes()
        self._followed = ""

    def start(
        self, encounters: Encounters | None, setting: Setting, rules: Rules, leader: LeaderRule, seed: int
    ) -> None:
        """See `World`."""
        self._setting, self._leader_rule, self._seed = setting, leader, seed
        self._horizon = rules.horizon_cycles

    @property
    def goes_on(self) -> bool:
        """See `World`."""
        return bool(self.time < self._end and self.session.expected_count() > 0)

    @property
    def host_count(self) -> int:
        """Hosts that have come in so far."""
        return len(self._actors.came)

    @property
    def encounters(self) -> Encounters:
        """See `World`; the initial states with the place of the lane change as the merging point."""
        start = np.array([one.start for one in self.kept]).reshape(-1, 4)
        merge_position = np.array([one.merge_position for one in self.kept])
        return Encounters.unlogged(
            np.array([f"{self._scene}/{one.name}" for one in self.kept], dtype=str),
            self._ramp.name,
            TRAFFIC,
            host_station=start[:, 0] - merge_position,
            host_speed=start[:, 1],
            host_length=np.array([one.host.length for one in self.kept]),
            merging_station=start[:, 2] - merge_position,
            merging_speed=start[:, 3],
            merging_length=np.array([one.merging.length for one in self.kept]),
            merge_position=merge_position,
        )

    def columns(self) -> dict[str, AnyArray]:
        """See `World`; also `cut_off` and `merging_stopped`, see `Meeting`."""
        return {
            "sumo_collision": np.array([one.collided for one in self.kept], dtype=bool),
            "cut_off": np.array([one.cut_off for one in self.kept], dtype=bool),
            "merging_stopped": np.array([one.stopped for one in self.kept], dtype=bool),
        }

    @property
    def leader(self) -> FloatArray | None:
        """See `World`."""
        found = np.tile([[math.inf], [0.0]], self.slots)
        for slot, meeting in self._by_slot.items():
            found[:, slot] = self._ahead[meeting.host.name]
        return found

    @property
    def room(self) -> FloatArray:
        """See `World`; once a car is past the usual merging point, it may come in up to the end of its lane."""
        left = np.zeros(self.slots)
        for slot, meeting in self._by_slot.items():
            x = meeting.merging.x
            if meeting.merged_at < 0 and x >= self._ramp.merging_point:
                left[slot] = max(self._ramp.ramp[-1].end - x, TOLERANCE)
        return left

    def show(self, log_odds: FloatArray) -> None:
        """See `World`; the view follows a host as long as that is on its way, then the next one."""
        hosts = {host.name: -math.inf for host in self._driven}
        for slot, meeting in self._by_slot.items():
            hosts[meeting.host.name] = max(hosts[meeting.host.name], float(log_odds[slot]))
        for name, odds in hosts.items():
            self.session.show(name, odds)
        if hosts and self._followed not in hosts:
            self._followed = next(iter(hosts))
            self.session.follow(self._followed)

    def command(self, speeds: FloatArray) -> None:
        """See `World`."""
        hosts = self._driven
        speed = np.array([host.speed for host in hosts])
        ahead = np.array([self._ahead[host.name] for host in hosts]).reshape(-1, 2).T
        free = np.maximum(speed + self._leader_rule.without_merging_car(speed, ahead) * self._setting.dt, 0.0)
        wanted = dict(zip((host.name for host in hosts), free.tolist(), strict=True))
        for slot, meeting in self._by_slot.items():
            wanted[meeting.host.name] = min(wanted[meeting.host.name], float(speeds[0, slot]))
        for name, value in wanted.items():
            self.session.set_speed(name, value)

    def step(self) -> None:
        """See `World`."""
        begin = perf_counter()
        self.session.step()
        self.step_s += perf_counter() - begin
        self.read()

    def read(self) -> None:
        """Take in what the last step did."""
        session = self.session
        self._cycle += 1
        self.time = session.time()
        self.vehicle_steps = (self.vehicle_steps or 0) + session.vehicle_count()
        if self.time > self._warm_up:
            self.arrived += session.arrived_count()
        self._actors.update()
        self._note_events()
        for meeting in list(self._by_slot.values()):
            self._follow_up(meeting)
        self._forget_merged()
        self._driven = [host for host in self._actors.hosts.values() if host.driven]
        self._ahead = {host.name: self._gap_ahead(host) for host in self._driven}
        contact = set(session.colliding()) if self._by_slot else set()
        for meeting in self._by_slot.values():
            meeting.stopped |= meeting.merged_at < 0 and meeting.merging.speed < STANDING
            meeting.collided |= not meeting.over and {meeting.host.name, meeting.merging.name} <= contact

    def observe(self, state: FloatArray, around: FloatArray) -> None:
        """See `World`; positions are rounded already. A slot that has just been freed keeps its last state."""
        for meeting in self._by_slot.values():
            self._look_at(meeting)
        state[:], around[:] = self._state, self._around

    def begin(self) -> Begun | None:
        """See `World`; a meeting begins where a host and a merging car come into each other's sight."""
        new = [self._meet(host, merging) for host, merging in self._in_sight()]
        if not new:
            return None
        for meeting in new:
            self._look_at(meeting)
        slots = np.array([meeting.slot for meeting in new])
        lengths = np.array([(meeting.host.length, meeting.merging.length) for meeting in new]).T
        names = np.array([f"{meeting.host.name} {meeting.merging.name}" for meeting in new])
        return Begun(
            slots,
            np.full(len(new), -1),
            np.concatenate([self._state[:, slots], lengths]),
            np.full(len(new), int(Intention.UNKNOWN)),
            stream_keys(names, self._seed),
            np.full(len(new), NEVER),
            self._around[:, slots],
        )

    def ended(self, over: IntArray, age: IntArray) -> Ended | None:
        """See `World`; a host attends to a merging car for a horizon after both have passed the place of its merge."""
        for slot in over.tolist():
            if slot in self._by_slot:
                self._by_slot[slot].over = True
        gone, self._gone = self._gone, []
        return self._ended(gone, age, back=1)

    def finish(self, age: IntArray) -> Ended | None:
        """See `World`."""
        still_open = list(self._by_slot.values())
        for meeting in still_open:
            self._release(meeting, cut_off=meeting.merged_at >= 0)
        self._gone = []
        return self._ended(still_open, age, back=0)

    def close(self) -> None:
        """Leave SUMO running; the caller that started it closes it."""

    def settled(self, track: FloatArray, point: float) -> FloatArray:
        """See `World`; a car that stood where it then changed lane is just before that place until it does."""
        track = track.copy()
        beside = track[MERGING_STATION] < -TOLERANCE
        for row, x in zip((HOST_STATION, MERGING_STATION), track[RECORDED:], strict=False):
            track[row] = x - point
        track[MERGING_STATION, beside] = np.minimum(track[MERGING_STATION, beside], -2 * TOLERANCE)
        return track

    def note_absent(self, announced: Iterable[str] = (), departures: Mapping[str, float] = _NO_DEPARTURES) -> None:
        """Note the hosts and other vehicles that never came in, that there were none, and cars that SUMO took out.

        Args:
            announced: Ids of vehicles and flows that are hosts by SUMO's files.
            departures: When the vehicles of SUMO's files are to depart [s].
        """
        waiting = [one for one in self.session.pending() if self._actors.role(one) == "host"]
        for name in waiting:
            line = f"host {name} never departed: no room where it was to enter"
            self.notes.add(Event.HOST_NOT_DEPARTED, name, line)
        known = {*waiting, *self._actors.came}
        for name in sorted(set(announced) - known - {one.rpartition(".")[0] for one in known}):
            line = f"host {name} never departed: not in the scene's time, or its file is not sorted by time"
            self.notes.add(Event.HOST_NOT_DEPARTED, name, line)
        missing = departures.keys() - self._actors.departed - known - set(announced) - set(self.session.pending())
        for name in sorted(name for name in missing if self.begun_at <= departures[name] < self.time - LATE):
            line = (
                f"vehicle {name} never departed: SUMO left it out, as where its file is not sorted by time of departure"
            )
            self.notes.add(Event.NOT_DEPARTED, name, line)
        # With time-to-teleport.remove SUMO takes cars out without saying which.
        for number in range(self._teleported() - self._teleports - self.notes.counts()[Event.TELEPORT]):
            self.notes.add(Event.TELEPORT, f"removed {number}", "SUMO took out a vehicle that had waited too long")
        if not self.host_count:
            self.notes.add(Event.NO_HOST, "", "no host came in that drives along the main road past the gore")
        if not self._actors.merging_came:
            line = "no car came in that is to merge: none drives over the on-ramp"
            if self._actors.roles_merging:
                line = "no car came in that is to merge: none is of a type with the role merging"
            self.notes.add(Event.NO_MERGING, "", line)

    def _ended(self, gone: list[Meeting], age: IntArray, back: int) -> Ended | None:
        if not gone:
            return None
        cases = []
        for meeting in gone:
            self._state[:, meeting.slot] = _NOBODY
            scored = meeting.merged_at >= 0 and age[meeting.slot] - back + 1 >= LEAST_STATES
            cases.append(len(self.kept) if scored else -1)
            if scored:
                self.kept.append(meeting)
        usual = self._ramp.merging_point
        return Ended(
            np.array([meeting.slot for meeting in gone]),
            np.array(cases),
            np.array([f"{self._scene}/{meeting.name}" for meeting in gone]),
            back,
            self.begun_at + np.array([meeting.begun for meeting in gone]) * self._setting.dt,
            np.array([meeting.merge_position if meeting.merged_at >= 0 else usual for meeting in gone]),
        )

    def _look_at(self, meeting: Meeting) -> None:
        """Put a meeting's state and what is around its host into its slot."""
        host, merging, slot = meeting.host, meeting.merging, meeting.slot
        point = meeting.merging_point(self._ramp.merging_point)
        self._state[:, slot] = host.x - point, merging.x - point, host.speed, merging.speed
        gap, leader_speed = self._ahead[host.name]
        follower_gap = self.session.follower(host.name, SIGHT).gap
        self._around[:, slot] = host.x, merging.x, gap, host.speed - leader_speed, follower_gap

    def _gap_ahead(self, host: Actor) -> tuple[float, float]:
        """Gap to the car ahead in the lane, bumper to bumper [m], inf without one, and its speed [m/s]."""
        leader = self.session.leader(host.name, SIGHT)
        return leader.gap, self.session.speed(leader.name) if leader.name else 0.0

    def _teleported(self) -> int:
        """Teleports so far, as SUMO counts them."""
        return int(self.session.statistic("stats.teleports.total"))

    def _follow_up(self, meeting: Meeting) -> None:
        """Take in a lane change, and end the meeting if it is over."""
        host, merging = meeting.host, meeting.merging
        here = host.name in self._actors.hosts and merging.name in self._actors.merging and host.driven
        if meeting.merged_at < 0:
            if here and merging.is_on(Part.HOST) and self._next_to_each_other(host, merging):
                meeting.merged_at, meeting.merge_position = self._cycle, merging.x
            elif not here or not merging.is_on(Part.MERGING) or abs(host.x - merging.x) > 2 * self._attention.apart:
                self._release(meeting)
        elif not here or not merging.is_on(Part.HOST):
            self._release(meeting, cut_off=True)
        if meeting.merged_at >= 0 and meeting.both_at < 0 and host.x >= meeting.merge_position:
            meeting.both_at = self._cycle
        elif 0 <= meeting.both_at < self._cycle - self._horizon and meeting.slot in self._by_slot:
            self._release(meeting)

    def _release(self, meeting: Meeting, cut_off: bool = False) -> None:
        meeting.cut_off = cut_off
        del self._by_slot[meeting.slot]
        self._gone.append(meeting)
        self.meetings += 1
        self.stopped += meeting.stopped

    def _forget_merged(self) -> None:
        """Watch no longer the merging cars that no host will meet any more."""
        open_now = {meeting.merging.name for meeting in self._by_slot.values()}
        for name, merging in list(self._actors.merging.items()):
            if merging.has_come and not merging.is_on(Part.MERGING) and name not in open_now:
                self._actors.forget(name)

    def _next_to_each_other(self, host: Actor, merging: Actor) -> bool:
        """No car is between the two, which are in one lane."""
        session = self.session
        return merging.name in (session.leader(host.name, SIGHT).name, session.follower(host.name, SIGHT).name)

    def _meet(self, host: Actor, merging: Actor) -> Meeting:
        """Begin a meeting, in the first free slot."""
        others = [one.host.name for one in self._by_slot.values() if one.merging is merging]
        if others:
            line = f"merging car {merging.name} meets two hosts at once, {others[0]} and {host.name}"
            self.notes.add(Event.TWO_HOSTS, merging.name, line)
        slot = next(slot for slot in range(self.slots + 1) if slot not in self._by_slot)
        if slot == self.slots:
            self.slots += BLOCK
            self._state = np.hstack([self._state, np.tile(_NOBODY[:, None], BLOCK)])
            self._around = np.pad(self._around, ((0, 0), (0, BLOCK)))
        start = (host.x, host.speed, merging.x, merging.speed)
        meeting = Meeting(host, merging, slot, self._cycle, start, stopped=merging.speed < STANDING)
        self._by_slot[slot] = meeting
        return meeting

    def _in_sight(self) -> Iterator[tuple[Actor, Actor]]:
        """The hosts and merging cars that attend to each other from now on."""
        attention, ramp = self._attention, self._ramp
        first, last = ramp.merging_point - attention.upstream, ramp.ramp[-1].end
        waiting = [car for car in self._actors.merging.values() if car.is_on(Part.MERGING) and car.x >= first]
        for host in self._actors.hosts.values():
            if host.lane is None or not first <= host.x <= last + attention.apart:
                continue
            if host.is_on(Part.BESIDE):
                line = f"host {host.name} drives beside the host lane, where it meets no merging car"
                self.notes.add(Event.HOST_OFF_LANE, host.name, line)
            if host.driven:
                for merging in waiting:
                    met = self._met.setdefault(merging.name, set())
                    near = merging.copy == host.copy and abs(host.x - merging.x) <= attention.apart
                    if near and host.name not in met:
                        met.add(host.name)
                        yield host, merging

    def _note_events(self) -> None:
        for name in self.session.teleporting():
            self.notes.add(Event.TELEPORT, f"{name} {self._cycle}", f"vehicle {name} was teleported by SUMO")
        for one, other, lane in self.session.contacts():
            event = Event.HOST_CONTACT if {one, other} & self._actors.hosts.keys() else Event.OTHER_CONTACT
            self.notes.add(event, f"{one} {other}", f"SUMO reports a contact of {one} and {other} on lane {lane}")
