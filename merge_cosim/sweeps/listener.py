"""A method as a step listener in a user's own script, which starts and steps SUMO itself."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.core.observation import Setting
from merge_cosim.core.units import DT, TOLERANCE
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.merging_cars.sumo import BySumo
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.results.rows import result_rows
from merge_cosim.scenarios.methods import Method, refuse_unused
from merge_cosim.scoring.rules import Rules
from merge_cosim.simulation.loop import Loop
from merge_cosim.simulation.worlds.meetings import DEFAULT_ATTENTION, Attention
from merge_cosim.simulation.worlds.traffic import TRAFFIC, TrafficWorld
from merge_cosim.sumo.attach import other_net
from merge_cosim.sumo.listener import StepListener
from merge_cosim.sumo.session import Session
from merge_cosim.sumo.tiles import tile_id
from merge_cosim.sweeps.plan import default_model


class HostListener(StepListener):  # type: ignore[misc]
    """Drives every host of a simulation by a method, after each of the user's `simulationStep()`.

    Hosts are the vehicles whose type carries the parameter `merge-cosim.role` = `host`. SUMO runs with steps of 0.1 s
    and `--no-internal-links true`.

    Attributes:
        world: What is driven; its `kept` meetings and its `notes` grow as the simulation goes on.
    """

    def __init__(
        self,
        api: Any,
        ramp: str | Path,
        method: str,
        *,
        model: str | None = None,
        settings: Mapping[str, Any] | None = None,
        speed_limit: float | None = None,
        host: str = "",
        attention: Attention = DEFAULT_ATTENTION,
        rules: Rules | None = None,
        seed: int = 0,
    ) -> None:
        """Drive the hosts of a simulation that has been started.

        Args:
            api: The module libsumo or traci, or a connection of traci.
            ramp: Name of a shipped ramp, or a folder with `ramp.toml`; SUMO runs on its net.
            method: Estimator, or estimator+controller.
            model: Model file or name; None for the project's own.
            settings: Parameters by `component.parameter`, as `acc.headway`.
            speed_limit: Speed of a host on a free road [m/s]; None for the ramp's limit.
            host: A vehicle, flow or type that is a host without the parameter.
            attention: Which merging cars a host attends to.
            rules: How encounters are scored.
            seed: Seed of the methods' random streams.

        Raises:
            UserError: There is no such ramp, method or parameter, or SUMO runs on another net, with other steps or with
                lanes inside junctions.
        """
        self._session, self._ramp, self._rules = Session(api), Ramp.load(ramp), rules or Rules()
        self._method = Method.of(method, settings)
        refuse_unused(settings or {}, [self._method])
        if self._method.is_human or self._method.needs_label:
            raise UserError(f"{method}: it rests on a log and cannot drive in living traffic")
        self._model = IntentionModel.load(model or default_model(TRAFFIC)) if self._method.needs_model else None
        self._setting = Setting(speed_limit or self._ramp.speed_limit)
        session = self._session
        if abs(float(session.option("step-length")) - DT) > TOLERANCE or session.option("no-internal-links") != "true":
            raise UserError(f"HostListener: start SUMO with --step-length {DT} --no-internal-links true")
        edges = {*self._ramp.main_route, *self._ramp.ramp_route}
        copied = session.has_edge(tile_id(0, self._ramp.main_route[0]))
        if not copied and (amiss := other_net(session, self._ramp.net, edges)):
            raise UserError(f"HostListener: {amiss}")
        self.world = TrafficWorld(session, self._ramp, host=host, attention=attention)
        driver = self._method.driver(self._model)
        self._loop = Loop(self.world, None, driver, BySumo(), self._rules, self._setting, seed=seed)

    def step(self, t: float = 0) -> bool:
        """Observe, estimate and command; called by `simulationStep()`.

        Raises:
            UserError: SUMO was asked for several steps at once.
        """
        if self._session.time() > self.world.time + DT + TOLERANCE:
            raise UserError("HostListener: several steps at once; call simulationStep() without a time")
        self.world.read()
        self._loop.after_step()
        self._loop.before_step()
        return True

    def results(self) -> pd.DataFrame:
        """End all open encounters and return one row per encounter, as in `results.parquet`; before SUMO is closed."""
        run = self._loop.finish()
        self.world.note_absent()
        names = {"scenario": "", "variation": "", "method": self._method.name}
        names["model"] = self._model.name if self._model else ""
        return result_rows(run, run.encounters, self._setting, self._rules.free, names, self._model).to_pandas()
