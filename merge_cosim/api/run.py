"""`merge_cosim.run`: a single case, with every cycle recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import pandas as pd

from merge_cosim.api.request import ScenarioLike, request_of
from merge_cosim.core.errors import UserError
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.report.story import outcome, story
from merge_cosim.scenarios.encounters import SourceChoice
from merge_cosim.scenarios.methods import MethodSpec
from merge_cosim.simulation.worlds.base import WorldKind
from merge_cosim.sumo.attach import Address
from merge_cosim.sumo.outputs import SumoOutputs
from merge_cosim.sweeps.other_cars import other_cars
from merge_cosim.sweeps.plan import plan, refuse_unsound_ramps
from merge_cosim.sweeps.single import NO_OUTPUTS, case_alone, trace_case
from merge_cosim.sweeps.task import Task

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from merge_cosim.report.film import Film, Stage

Quantity = Literal["station", "speed", "log_odds"]


@dataclass(frozen=True, repr=False)
class Run:
    """One case under one method.

    Attributes:
        row: The result row, as in `results.parquet`; of a whole scene of living traffic, its facts.
        trace: One row per cycle: time, station and speed of both cars, log-odds, command.
        task: What was run.
    """

    row: dict[str, Any]
    trace: pd.DataFrame
    task: Task

    def plot(self, quantity: Quantity = "station") -> Figure:
        """Draw both cars over time.

        Args:
            quantity: `"station"` or `"speed"` of both cars, or the estimator's `"log_odds"`.

        Raises:
            UserError: There is nothing to draw, as the log-odds of a plain rule or a whole scene of living traffic.
        """
        from merge_cosim.api.plots import case_figure

        if "method" not in self.row or "failed" not in self.row:
            raise UserError(
                "plot: this is a whole scene of living traffic; run one of its encounters (SCENE/HOST/MERGING)"
            )
        method = str(self.row["method"])
        return case_figure(self.trace.assign(method=method), {method: bool(self.row["failed"])}, quantity)

    def video(self, file: str | Path) -> Path:
        """Write a video in real time: both cars on the ramp from above, belief and decision.

        In a scene the other cars are drawn in grey; the case is run once more for them.

        Example:
            >>> run.video("case.gif")  # doctest: +SKIP

        Args:
            file: The file, .gif or, with ffmpeg (`pip install 'merge-cosim[video]'`), .mp4.

        Returns:
            The file.

        Raises:
            UserError: Another kind of file, no ffmpeg, or a whole scene of living traffic.
        """
        from merge_cosim.report.film import VIDEOS, check_file

        check_file("video", file, VIDEOS)
        self._film("video").write(Path(file))
        return Path(file)

    def stills(self, count: int, file: str | Path) -> list[Path]:
        """Write single frames of the video, evenly over the case, the last one with the outcome.

        Example:
            >>> run.stills(4, "still.svg")  # doctest: +SKIP

        Args:
            count: How many.
            file: Such as `still.png`, for `still-1.png`, `still-2.png` and so on; .svg and .pdf, too.

        Returns:
            The files.

        Raises:
            UserError: Another kind of file, no still at all, or a whole scene of living traffic.
        """
        from merge_cosim.report.film import STILLS, check_file

        check_file("stills", file, STILLS)
        if count < 1:
            raise UserError(f"stills: {count} of them; give 1 or more")
        wanted = Path(file)
        wanted.parent.mkdir(parents=True, exist_ok=True)
        files = []
        for number, figure in enumerate(self._film("stills").stills(count), 1):
            files.append(wanted.with_name(f"{wanted.stem}-{number}{wanted.suffix}"))
            figure.savefig(files[-1])
        return files

    @cached_property
    def stage(self) -> Stage:
        """Where it took place."""
        from merge_cosim.report.film import Stage

        pairs, ramp = self.task.cases.encounters, self.task.ramp
        if pairs is not None:
            lengths = float(pairs.host_length[0]), float(pairs.merging_length[0])
            return Stage(ramp, self.task.scenario.host, lengths, float(pairs.merge_position[0]))
        first = self.trace.iloc[0]
        return Stage(ramp, merge_position=float(first["host_x_m"] - first["host_station_m"]))

    def _film(self, what: str) -> Film:
        from merge_cosim.report.film import Film

        if "failed" not in self.row:
            raise UserError(
                f"{what}: this is a whole scene of living traffic; run one of its encounters (SCENE/HOST/MERGING)"
            )
        title = "{scenario} {case}, {method}".format(**self.row)
        return Film(self.stage, self.trace, title, outcome(self.row), other_cars(self.task, str(self.row["case"])))

    def __repr__(self) -> str:
        return "\n".join((*story(self.row), f"({len(self.trace):,} cycles in .trace)"))

    def _repr_html_(self) -> str:
        """What happened, and the report's case viewer."""
        from merge_cosim.report.notebook import case_page, frame, pairs_html

        first, *others = story(self.row)
        facts = pairs_html([("case", first), *((line[:8].strip(), line[8:]) for line in others)])
        if "failed" not in self.row or self.trace.empty:
            return facts
        return facts + frame(case_page(self.row, self.trace), "The case, to be watched")

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str]:
        return {"text/plain": repr(self), "text/html": self._repr_html_()}


def run(
    scenario: ScenarioLike,
    case: str,
    method: MethodSpec,
    *,
    model: str | Path | IntentionModel | None = None,
    settings: Mapping[str, Any] | None = None,
    data: str | Path | None = None,
    source: SourceChoice | None = None,
    seed: int = 0,
    plugins: Sequence[str | Path] = (),
    world: WorldKind = "sumo",
    gui: bool = False,
    delay: int = 100,
    trace: str | Path | None = None,
    outputs: SumoOutputs = NO_OUTPUTS,
    attach: str | None = None,
    stays: bool = True,
    unchecked_ramp: bool = False,
) -> Run:
    """Run a single case; its outcome is the same as in a sweep.

    Example:
        >>> run = mc.run("designed-2", case="d+1_h15_m14", method="pgm")  # doctest: +SKIP
        >>> run.plot("speed")  # doctest: +SKIP

    Args:
        scenario: A scenario, as `merge_cosim.sweep` takes it.
        case: Name of the case, as in the column `case` of the rows.
        method: A method, as `merge_cosim.sweep` takes it.
        model: As in `merge_cosim.sweep`.
        settings: As in `merge_cosim.sweep`.
        data: As in `merge_cosim.sweep`.
        source: As in `merge_cosim.sweep`.
        seed: As in `merge_cosim.sweep`.
        plugins: As in `merge_cosim.sweep`.
        world: As in `merge_cosim.sweep`.
        gui: Show it in sumo-gui, with the host's belief and decision as its parameters and the decision as its colour
            (blue: goes first, light blue: follows).
        delay: With `gui`: milliseconds per step; 100 is real time.
        trace: File to write the trace to (.csv or .parquet).
        outputs: Files that SUMO is to write.
        unchecked_ramp: Run on a ramp that does not pass `ramp check`, too, which is refused otherwise.
        attach: `HOST:PORT` of a SUMO that runs with `--remote-port`, to drive in that one.
        stays: With `gui`: the window stays until it is closed by hand.

    Returns:
        The result row and the trace.

    Raises:
        UserError: There is no such scenario, case or method, or what is asked for does not fit.
    """
    request = request_of(
        scenario,
        [method],
        model=model,
        settings=settings,
        data=data,
        source=source,
        seed=seed,
        plugins=plugins,
        world=world,
        unchecked_ramp=unchecked_ramp,
    )
    if trace is not None and Path(trace).suffix not in (".csv", ".parquet"):
        raise UserError(f"{trace}: a trace is written as .csv or .parquet")
    address = Address.parse(attach) if attach else None
    tasks = plan(request)
    refuse_unsound_ramps(request, tasks)
    task = case_alone(tasks, case)
    row, record = trace_case(task, case, delay if gui else None, outputs, address, stays)
    if trace is not None:
        Path(trace).parent.mkdir(parents=True, exist_ok=True)
        if Path(trace).suffix == ".csv":
            record.to_csv(trace, index=False)
        else:
            record.to_parquet(trace, index=False)
    return Run(row, record, task)
