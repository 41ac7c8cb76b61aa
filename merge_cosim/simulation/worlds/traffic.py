"""One scene from its SUMO configuration to scored meetings and facts about the traffic."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from merge_cosim.core.observation import Setting
from merge_cosim.core.units import HOUR
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Effort
from merge_cosim.simulation.worlds.host_controller import HostController
from merge_cosim.simulation.worlds.meeting_scores import to_be_scored
from merge_cosim.simulation.worlds.meetings import DEFAULT_ATTENTION, Attention, Meeting
from merge_cosim.simulation.worlds.notes import Event
from merge_cosim.sumo.attach import Address, AttachedSession
from merge_cosim.sumo.options import TRAFFIC, SumoOptions, delay_option
from merge_cosim.sumo.session import Session
from merge_cosim.sumo.start import open_session, running

_STATISTICS = {
    "vehicles": "stats.vehicles.inserted",
    "waiting": "stats.vehicles.waiting",
    "emergency_brakings": "stats.safety.emergencyBraking",
    "mean_speed": "device.tripinfo.speed",
    "time_loss_s": "device.tripinfo.timeLoss",
}
"""What SUMO counts of a scene: cars that came in, and that wait outside; hard brakings of its own cars; and of the cars
that have left the net, their mean speed [m/s] and what they lost against free driving [s]."""


@dataclass(frozen=True)
class Scene:
    """A simulation to be run.

    Attributes:
        name: Its name in results.
        file: The `.sumocfg`.
        ramp: The ramp whose net, or copies of it, it loads.
        seed: SUMO's seed.
        end: Its end [s]; inf for when the last car has left.
        warm_up: The throughput is counted from here on [s].
        host: A vehicle, flow or type that is a host without saying so.
        announced: Ids of vehicles and flows that are hosts by the files.
        attention: Which merging cars a host attends to.
    """

    name: str
    file: Path
    ramp: Ramp
    seed: int
    end: float
    warm_up: float = 0.0
    host: str = ""
    announced: tuple[str, ...] = ()
    attention: Attention = DEFAULT_ATTENTION


@dataclass
class SceneRun:
    """What came out of a scene.

    Attributes:
        meetings: All meetings.
        facts: Counts and means of its traffic; None for a mean over no car.
        notes: What its user should know, a line for each event.
        effort: What it cost.
        begin: Time at which it began [s].
    """

    meetings: list[Meeting]
    facts: dict[str, Any]
    notes: list[tuple[Event, str]]
    effort: Effort
    begin: float


def run_scene(
    scene: Scene,
    driver: HostDriver,
    setting: Setting,
    horizon: float,
    gui_delay: int | None = None,
    extra: tuple[str, ...] = (),
    attach: Address | None = None,
) -> SceneRun:
    """Run a scene, its hosts driven by a method.

    Args:
        scene: The scene.
        driver: The method.
        setting: Speed of free driving and cycle.
        horizon: How long a meeting goes on once both cars are past the place of the lane change [s].
        gui_delay: Milliseconds per step in sumo-gui; None runs without a window.
        extra: Further options of SUMO.
        attach: Drive the hosts of the SUMO that listens there, whatever its configuration, instead of one of our own.

    Raises:
        UserError: SUMO refuses the configuration, at its start or on the way; or see `AttachedSession`.
    """
    with running(_open(scene, gui_delay, extra, attach), scene.file) as session:
        started = perf_counter()
        controller = HostController(
            session,
            scene.ramp,
            driver,
            setting,
            scene.attention,
            horizon,
            scene.seed,
            scene.host,
        )
        effort = Effort()
        arrived = 0
        time = begin = session.time()
        while time < scene.end and session.expected_count() > 0:
            before = perf_counter()
            session.step()
            effort.step_s += perf_counter() - before
            controller.cycle()
            effort.vehicle_steps += session.vehicle_count()
            time = session.time()
            if time > scene.warm_up:
                arrived += session.arrived_count()
        controller.close(scene.announced if attach is None else ())
        effort.wall_s, effort.scene_s = perf_counter() - started, time - begin
        statistics = {name: session.statistic(key) for name, key in _STATISTICS.items()}
        left = int(session.statistic("device.tripinfo.count"))
        facts: dict[str, Any] = {
            "simulated_s": round(time - begin, 3),
            "throughput_veh_h": round(HOUR * arrived / max(time - max(scene.warm_up, begin), setting.dt), 1),
            **statistics,
            **{name: round(statistics[name], 2) if left else None for name in ("mean_speed", "time_loss_s")},
            "hosts": controller.host_count,
            "meetings": len(controller.finished),
            "meetings_scored": len(to_be_scored(controller.finished)),
            "merging_stopped": sum(meeting.stopped for meeting in controller.finished),
            **controller.notes.counts(),
        }
        return SceneRun(controller.finished, facts, controller.notes.lines, effort, begin)


def _open(scene: Scene, gui_delay: int | None, extra: tuple[str, ...], attach: Address | None) -> Session:
    """SUMO with the scene's configuration, under the conditions that the controller rests on."""
    window = () if gui_delay is None else delay_option(gui_delay)
    options = SumoOptions(scene.ramp.net, scene.seed, (*extra, *window), TRAFFIC, scene.file)
    if attach is None:
        return open_session(options, gui=gui_delay is not None)
    session = AttachedSession(options, attach)
    session.require_edges({*scene.ramp.main_route, *scene.ramp.ramp_route})
    return session
