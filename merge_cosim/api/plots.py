"""The figures of `Results.plot` and `Run.plot`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import pandas as pd

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from merge_cosim.api.results import Results


class Plots:
    """Figures of a sweep; each is a `matplotlib.figure.Figure`, to be shown in a notebook or saved by `savefig`."""

    def __init__(self, results: Results) -> None:
        """Draw from these results."""
        self._results = results

    def failure_map(self, scenario: str | None = None, methods: list[str] | None = None) -> Figure:
        """Share of failed cases by both initial speeds, one small map per method.

        Args:
            scenario: A scenario; not needed where the sweep has one only.
            methods: Methods to draw; all, if not given.

        Raises:
            UserError: There is no such scenario or method.
        """
        from merge_cosim.report.set_figures import failure_map

        return failure_map(self._rows(scenario, methods))

    def delay(self, scenario: str | None = None, methods: list[str] | None = None) -> Figure:
        """Delay of each case against how ambiguous its start was, one panel per method; failures as red crosses.

        Args:
            scenario: A scenario; not needed where the sweep has one only.
            methods: Methods to draw; all, if not given.

        Raises:
            UserError: There is no such scenario or method.
        """
        from merge_cosim.report.methods import looks
        from merge_cosim.report.set_figures import ambiguity_figure

        rows = self._rows(scenario, methods)
        return ambiguity_figure(rows, looks(rows["method"]))

    def variation(self, parameter: str, scenario: str | None = None) -> Figure:
        """Failure rate by the values of a varied parameter.

        Args:
            parameter: What was varied, such as `acc.headway`.
            scenario: A scenario; not needed where the sweep has one only.

        Raises:
            UserError: There is no such scenario, or the parameter was not varied.
        """
        from merge_cosim.report.methods import looks
        from merge_cosim.report.set_figures import variation_figure

        summary = self._results.summary()
        summary = summary[summary["scenario"] == self._scenario(scenario)]
        varied = sorted({one.partition("=")[0] for one in summary["variation"] if one})
        if parameter not in varied:
            raise UserError(f"parameter '{parameter}' was not varied in this sweep{did_you_mean(parameter, varied)}")
        return variation_figure(summary, parameter, looks(summary["method"]))

    def case(self, quantity: str = "station", scenario: str | None = None, case: str | None = None) -> Figure:
        """A recorded case: both cars over time under every method.

        Args:
            quantity: `"station"` or `"speed"` of both cars, or the estimators' `"log_odds"`.
            scenario: A scenario; not needed where the sweep has one only.
            case: Its name; the case on which the methods differ most, if not given.

        Raises:
            UserError: There is no such scenario, or no trace of it.
        """
        name = self._scenario(scenario)
        traces = self._results.traces
        traces = traces[traces["scenario"] == name]
        if traces.empty:
            raise UserError(f"scenario {name}: no trace of it is stored; use mc.run(...).plot()")
        recorded = traces["case"].unique().tolist()
        if case is not None and case not in recorded:
            raise UserError(
                f"plot: case '{case}' is not recorded{did_you_mean(case, recorded)}; use mc.run(...).plot()"
            )
        traces = traces[traces["case"] == (case or recorded[0])]
        rows = self._rows(name, None)
        rows = rows[rows["case"] == traces["case"].iloc[0]]
        return case_figure(traces, dict(zip(rows["method"], rows["failed"].astype(bool), strict=True)), quantity)

    def _scenario(self, chosen: str | None) -> str:
        names = sorted(self._results.rows["scenario"].unique())
        if chosen is None and len(names) == 1:
            return str(names[0])
        if chosen is None:
            raise UserError(f"plot: choose a scenario of these results: {', '.join(names)}")
        if chosen not in names:
            raise UserError(f"plot: no scenario '{chosen}' in these results{did_you_mean(chosen, names)}")
        return chosen

    def _rows(self, scenario: str | None, methods: list[str] | None) -> pd.DataFrame:
        rows = self._results.rows
        for method in methods or ():
            if method not in self._results.methods:
                raise UserError(
                    f"plot: no method '{method}' in these results{did_you_mean(method, self._results.methods)}"
                )
        chosen = (rows["scenario"] == self._scenario(scenario)) & (rows["variation"] == "")
        return rows[chosen & rows["method"].isin(methods or self._results.methods)]


def case_figure(traces: pd.DataFrame, failed: Mapping[str, bool], quantity: str) -> Figure:
    """Draw one case.

    Args:
        traces: Its records, with the column `method`.
        failed: For each method, whether the case failed.
        quantity: `station`, `speed` or `log_odds`.

    Raises:
        UserError: There is no such quantity, or no log-odds.
    """
    from merge_cosim.report.case_figures import log_odds_figure, path_figures
    from merge_cosim.report.methods import looks

    drawn = looks(traces["method"])
    if quantity == "log_odds":
        figure = log_odds_figure(traces, drawn)
        if figure is None:
            raise UserError("plot: the estimator is a plain rule without log-odds; plot 'station' or 'speed'")
        return figure
    if quantity not in ("station", "speed"):
        raise UserError(f"plot: no quantity '{quantity}'{did_you_mean(quantity, ['station', 'speed', 'log_odds'])}")
    stations, speeds = path_figures(traces, failed, drawn)
    return stations if quantity == "station" else speeds
