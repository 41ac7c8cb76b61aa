"""A method at the wheel of every host of a running SUMO, which drives all other cars."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from copy import deepcopy

import numpy as np

from merge_cosim.controllers.acc import Acc
from merge_cosim.controllers.law import FollowingLaw
from merge_cosim.core.observation import Setting
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.scoring.scoring import Rules
from merge_cosim.scoring.surroundings import SIGHT
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.worlds.actors import Actor, Actors
from merge_cosim.simulation.worlds.meetings import DEFAULT_ATTENTION, Attention, Ending, Meeting
from merge_cosim.simulation.worlds.notes import Event, Notes
from merge_cosim.simulation.worlds.slots import SlotBatch
from merge_cosim.sumo.lane_map import LaneMap, Part
from merge_cosim.sumo.session import Session


class HostController:
    """Observes, estimates and commands once per cycle, between two steps of SUMO.

    Every (host, merging car) in each other's sight is a *meeting* and has a row in one of the method's batches. A host
    drives by the smallest of the accelerations that its controller gives for its meetings, the law of following its
    leader in the lane, and free driving.

    Where a car will merge is not known before it does: station 0 is the ramp's usual merging point, and once the car is
    past it, just ahead of it; from the lane change on it is where it changed.

    Attributes:
        finished: The meetings that are over, in the order of their end.
        notes: What went on.
    """

    def __init__(
        self,
        session: Session,
        ramp: Ramp,
        driver: HostDriver,
        setting: Setting,
        attention: Attention = DEFAULT_ATTENTION,
        horizon: float = Rules.horizon,
        seed: int = 0,
        host: str = "",
    ) -> None:
        """Take the wheel.

        Args:
            session: A running SUMO.
            ramp: The ramp whose net, or copies of it, is loaded.
            driver: The method.
            setting: The speed that a host drives at if nobody hinders it, and the cycle.
            attention: Which merging cars a host attends to.
            horizon: A meeting lasts until both cars have been past the place of the lane change for this long [s].
            seed: Seed of the methods' random streams.
            host: A vehicle, flow or type that is a host without saying so.
        """
        self._session, self._ramp, self._driver, self._setting = session, ramp, driver, setting
        self._attention, self._seed = attention, seed
        self._horizon = round(horizon / setting.dt)
        controller = driver.controller
        self._law: FollowingLaw = controller if isinstance(controller, FollowingLaw) else Acc()
        self._actors = Actors(session, LaneMap(ramp), host)
        self._batches: list[SlotBatch] = []
        self._open: dict[Meeting, SlotBatch] = {}
        self._met: dict[str, set[str]] = {}
        self._cycle = 0
        self._teleports = self._teleported()
        self.finished: list[Meeting] = []
        self.notes = Notes()

    def cycle(self) -> None:
        """Observe what the last step did, and command the next one."""
        self._actors.update()
        self._note_events()
        self._end_meetings()
        self._begin_meetings()
        hosts = [host for host in self._actors.hosts.values() if host.driven]
        wanted, ahead = self._by_leader(hosts)
        met = {meeting.host.name for meeting in self._open}
        behind = {name: self._session.follower(name, SIGHT).gap for name in met}
        contact = set(self._session.colliding()) if self._open else set()
        for slots in self._batches:
            for meeting, log_odds, acceleration in slots.decide(self._ramp.merging_point):
                name = meeting.host.name
                meeting.record(log_odds, *ahead[name], behind[name], {name, meeting.merging.name} <= contact)
                wanted[name] = min(wanted[name], acceleration)
        for host in hosts:
            self._session.set_speed(host.name, max(host.speed + wanted[host.name] * self._setting.dt, 0.0))
        self._cycle += 1

    @property
    def host_count(self) -> int:
        """Hosts that have come in so far."""
        return len(self._actors.came)

    def close(self, announced: Iterable[str] = ()) -> None:
        """End the meetings that are still open, and note the hosts that never came in, or that there were none.

        Args:
            announced: Ids of vehicles and flows that are hosts by SUMO's files.
        """
        for meeting in list(self._open):
            self._end(meeting, Ending.CENSORED if meeting.merged_at >= 0 else Ending.NOT_NEXT)
        waiting = [one for one in self._session.pending() if self._actors.role(one) == "host"]
        for name in waiting:
            line = f"host {name} never departed: no room where it was to enter"
            self.notes.add(Event.HOST_NOT_DEPARTED, name, line)
        known = {*waiting, *self._actors.came}
        for name in sorted(set(announced) - known - {one.rpartition(".")[0] for one in known}):
            line = f"host {name} never departed: not in the scene's time, or its file is not sorted by time"
            self.notes.add(Event.HOST_NOT_DEPARTED, name, line)
        # With time-to-teleport.remove SUMO takes cars out without saying which.
        for number in range(self._teleported() - self._teleports - self.notes.counts()[Event.TELEPORT]):
            self.notes.add(Event.TELEPORT, f"removed {number}", "SUMO took out a vehicle that had waited too long")
        if not self.host_count:
            self.notes.add(Event.NO_HOST, "", "no host came in that drives along the main road past the gore")

    def _teleported(self) -> int:
        """Teleports so far, as SUMO counts them."""
        return int(self._session.statistic("stats.teleports.total"))

    def _by_leader(self, hosts: list[Actor]) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
        """By each host's name: acceleration behind its leader [m/s^2]; the leader's gap and speed [m, m/s]."""
        ahead = {}
        for host in hosts:
            leader = self._session.leader(host.name, SIGHT)
            ahead[host.name] = (leader.gap, self._session.speed(leader.name) if leader.name else 0.0)
        speed = np.array([host.speed for host in hosts])
        gap, leader_speed = np.array(list(ahead.values())).reshape(-1, 2).T
        led = np.isfinite(gap)
        wanted = self._law.drive(led, np.where(led, gap, 0.0), speed, leader_speed, self._setting.speed_limit)
        return dict(zip(ahead, wanted.tolist(), strict=True)), ahead

    def _end_meetings(self) -> None:
        """Take in lane changes, end what is over, and forget the merging cars that nobody will meet any more."""
        present = self._actors
        for meeting in list(self._open):
            host, merging = meeting.host, meeting.merging
            here = host.name in present.hosts and merging.name in present.merging and host.driven
            if meeting.merged_at < 0:
                self._await_lane_change(meeting, here)
            elif not here or not merging.is_on(Part.HOST):
                self._end(meeting, Ending.CENSORED)
            if meeting.merged_at >= 0 and meeting.both_at < 0 and host.x >= meeting.merge_position:
                meeting.both_at = len(meeting.states)
            elif 0 <= meeting.both_at < len(meeting.states) - self._horizon and meeting in self._open:
                self._end(meeting, Ending.SCORED)
        open_now = {meeting.merging.name for meeting in self._open}
        for name, merging in list(present.merging.items()):
            if merging.has_come and not merging.is_on(Part.MERGING) and name not in open_now:
                present.forget(name)

    def _await_lane_change(self, meeting: Meeting, here: bool) -> None:
        host, merging = meeting.host, meeting.merging
        if here and merging.is_on(Part.HOST) and self._next_to_each_other(host, merging):
            meeting.merged_at, meeting.merge_position = len(meeting.states), merging.x
        elif not here or not merging.is_on(Part.MERGING) or abs(host.x - merging.x) > 2 * self._attention.apart:
            self._end(meeting, Ending.NOT_NEXT)

    def _next_to_each_other(self, host: Actor, merging: Actor) -> bool:
        """No car is between the two, which are in one lane."""
        session = self._session
        return merging.name in (session.leader(host.name, SIGHT).name, session.follower(host.name, SIGHT).name)

    def _end(self, meeting: Meeting, ending: Ending) -> None:
        self._open.pop(meeting).end(meeting)
        meeting.ending = ending
        self.finished.append(meeting)

    def _begin_meetings(self) -> None:
        for host, merging in self._in_sight():
            met = self._met.setdefault(merging.name, set())
            if host.name in met:
                continue
            met.add(host.name)
            others = [one.host.name for one in self._open if one.merging is merging]
            if others:
                line = f"merging car {merging.name} meets two hosts at once, {others[0]} and {host.name}"
                self.notes.add(Event.TWO_HOSTS, merging.name, line)
            meeting = Meeting(host, merging, self._cycle)
            slots = next((slots for slots in self._batches if not slots.is_full), None) or self._new_batch()
            slots.begin(meeting, self._seed)
            self._open[meeting] = slots

    def _new_batch(self) -> SlotBatch:
        self._batches.append(SlotBatch(deepcopy(self._driver), self._setting))
        return self._batches[-1]

    def _in_sight(self) -> Iterator[tuple[Actor, Actor]]:
        attention, ramp = self._attention, self._ramp
        first, last = ramp.merging_point - attention.upstream, ramp.ramp[-1].end
        waiting = [car for car in self._actors.merging.values() if car.is_on(Part.MERGING) and car.x >= first]
        for host in self._actors.hosts.values():
            if host.lane is None or not first <= host.x <= last + attention.apart:
                continue
            if host.is_on(Part.BESIDE):
                line = f"host {host.name} drives beside the host lane, where it meets nobody"
                self.notes.add(Event.HOST_OFF_LANE, host.name, line)
            if host.driven:
                for merging in waiting:
                    if merging.copy == host.copy and abs(host.x - merging.x) <= attention.apart:
                        yield host, merging

    def _note_events(self) -> None:
        for name in self._session.teleporting():
            self.notes.add(Event.TELEPORT, f"{name} {self._cycle}", f"vehicle {name} was teleported by SUMO")
        for one, other, lane in self._session.contacts():
            event = Event.HOST_CONTACT if {one, other} & self._actors.hosts.keys() else Event.OTHER_CONTACT
            self.notes.add(event, f"{one} {other}", f"SUMO reports a contact of {one} and {other} on lane {lane}")
