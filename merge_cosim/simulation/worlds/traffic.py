"""One scene from its SUMO configuration to scored meetings and facts about the traffic."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Setting
from merge_cosim.core.units import HOUR
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.simulation.host_driver import HostDriver
from merge_cosim.simulation.loop import Effort
from merge_cosim.simulation.worlds.host_controller import HostController
from merge_cosim.simulation.worlds.meeting_scores import to_be_scored
from merge_cosim.simulation.worlds.meetings import DEFAULT_ATTENTION, Attention, Meeting
from merge_cosim.simulation.worlds.notes import Event
from merge_cosim.sumo.attach import Address, attached_to, refuse_other_net
from merge_cosim.sumo.session import (
    SumoOptions,
    connection_kept,
    delay_option,
    libsumo_started,
    one_line,
    traci_started,
)

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
        UserError: SUMO refuses the configuration, at its start or on the way; or see `attached_to`.
    """
    with _running_sumo(scene, gui_delay, extra, attach) as api:
        started = perf_counter()
        controller = HostController(
            api,
            scene.ramp,
            driver,
            setting,
            scene.attention,
            horizon,
            scene.seed,
            scene.host,
        )
        effort = Effort()
        simulation, count, arrived = api.simulation, api.vehicle.getIDCount, 0
        time = begin = simulation.getTime()
        while time < scene.end and simulation.getMinExpectedNumber() > 0:
            before = perf_counter()
            api.simulationStep()
            effort.step_s += perf_counter() - before
            controller.cycle()
            effort.vehicle_steps += count()
            time = simulation.getTime()
            if time > scene.warm_up:
                arrived += simulation.getArrivedNumber()
        controller.close(scene.announced if attach is None else ())
        effort.wall_s, effort.scene_s = perf_counter() - started, time - begin
        statistics = {name: float(simulation.getParameter("", key)) for name, key in _STATISTICS.items()}
        left = int(simulation.getParameter("", "device.tripinfo.count"))
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


@contextmanager
def _running_sumo(scene: Scene, gui_delay: int | None, extra: tuple[str, ...], attach: Address | None) -> Iterator[Any]:
    """SUMO with the scene's configuration, under the conditions that the controller rests on."""
    conditions = SumoOptions(scene.ramp.net).conditions
    del conditions["time-to-teleport"]  # the user's, whose teleports are counted
    options = {
        "configuration-file": scene.file,
        **conditions,
        "no-internal-links": "true",
        "seed": scene.seed,
        "device.tripinfo.probability": 1,
        "no-step-log": "true",
        "no-warnings": "true",
        "verbose": "false",
        "duration-log.disable": "true",
        "duration-log.statistics": "false",
        "xml-validation": "never",
    }
    words = [str(word) for name, value in options.items() for word in (f"--{name}", value)] + list(extra)
    if attach is not None:
        api, errors = attached_to(attach, conditions)
        refuse_other_net(api, scene.ramp.net, {*scene.ramp.main_route, *scene.ramp.ramp_route}, attach)
    elif gui_delay is None:
        words += ["--remote-port", "0"]  # SUMO would wait there for somebody
        api, errors = libsumo_started(words, scene.file)
    else:
        words += delay_option(gui_delay)
        api, errors = traci_started(words, scene.file, gui=True)
    try:
        with connection_kept():
            yield api
    except errors as error:
        raise UserError(f"{scene.file}: SUMO stopped: {one_line(error)}") from None
    finally:
        api.close()
