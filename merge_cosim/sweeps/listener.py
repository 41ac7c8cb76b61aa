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
from merge_cosim.ramps.ramp import Ramp
from merge_cosim.results.statistics.summary import TRAFFIC
from merge_cosim.scenarios.methods import Method
from merge_cosim.scoring.scoring import Rules
from merge_cosim.simulation.worlds.host_controller import HostController
from merge_cosim.simulation.worlds.meetings import DEFAULT_ATTENTION, Attention
from merge_cosim.sumo.attach import other_net
from merge_cosim.sumo.listener import StepListener
from merge_cosim.sumo.session import Session
from merge_cosim.sumo.tiles import tile_id
from merge_cosim.sweeps.plan import default_model
from merge_cosim.sweeps.scene_task import meeting_rows


class HostListener(StepListener):  # type: ignore[misc]
    """Drives every host of a simulation by a method, after each of the user's `simulationStep()`.

    Hosts are the vehicles whose type carries the parameter `merge-cosim.role` = `host`. SUMO runs with steps of 0.1 s
    and `--no-internal-links true`.

    Attributes:
        controller: What drives; its `finished` meetings and its `notes` grow as the simulation goes on.
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
        """Take the wheel in a simulation that has been started.

        Args:
            api: The module libsumo or traci, or a connection of traci.
            ramp: Name of a shipped ramp, or a folder with `ramp.toml`; SUMO runs on its net.
            method: Estimator, or estimator+controller.
            model: Model file or name; None for the project's own.
            settings: Parameters by `component.parameter`, as `acc.headway`.
            speed_limit: Speed of a host that nobody hinders [m/s]; None for the ramp's limit.
            host: A vehicle, flow or type that is a host without saying so.
            attention: Which merging cars a host attends to.
            rules: How meetings are scored.
            seed: Seed of the methods' random streams.

        Raises:
            UserError: There is no such ramp, method or parameter, or SUMO runs on another net, with other steps or with
                lanes inside junctions.
        """
        self._session, self._ramp, self._rules = Session(api), Ramp.load(ramp), rules or Rules()
        self._method = Method.of(method, settings)
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
        self._time = session.time()
        driver = self._method.driver(self._model)
        self.controller = HostController(
            session, self._ramp, driver, self._setting, attention, self._rules.horizon, seed, host
        )

    def step(self, t: float = 0) -> bool:
        """Observe, estimate and command; called by `simulationStep()`.

        Raises:
            UserError: SUMO was asked for several steps at once.
        """
        time = self._session.time()
        if time > self._time + DT + TOLERANCE:
            raise UserError("HostListener: several steps at once; call simulationStep() without a time")
        self._time = time
        self.controller.cycle()
        return True

    def results(self) -> pd.DataFrame:
        """End all open meetings and return one row per meeting, as in `results.parquet`; before SUMO is closed."""
        self.controller.close()
        names = {"scenario": "", "variation": "", "method": self._method.name}
        names["model"] = self._model.name if self._model else ""
        rows = meeting_rows(
            self.controller.finished, "000", self._ramp, self._rules, self._setting, self._rules.free, names
        )
        return rows.to_pandas()
