"""`merge_cosim.Results`: what came out of a sweep."""

from __future__ import annotations

import ast
import os
import shutil
import weakref
from collections.abc import Sequence, Set
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from merge_cosim.api.plots import Plots
from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean
from merge_cosim.core.units import BoolArray
from merge_cosim.ngsim.data import find_data
from merge_cosim.report.comparison import compare
from merge_cosim.report.run_command import run_command
from merge_cosim.results.notes import note_lines
from merge_cosim.results.schema import SCHEMA
from merge_cosim.results.statistics.summary import CASE
from merge_cosim.results.store import ENSEMBLE_CSV, MANIFEST, RIVALS_CSV, ResultFolder

if TYPE_CHECKING:
    from merge_cosim.report.short_table import ShortTable
    from merge_cosim.sweeps.verify import Verification

EXAMPLE = "write one such as \"failed and method == 'pgm'\""


class Results:
    """The results of a sweep, read from its folder when they are asked for.

    Shown as a table: a row per scenario and method, with the main measures.

    Attributes:
        path: The result folder.
    """

    def __init__(self, path: str | Path, temporary: bool = False) -> None:
        """Open a folder; see `load_results`.

        Args:
            path: The folder.
            temporary: Remove it along with this object, or when Python ends.
        """
        self.path = Path(path)
        self._store = ResultFolder(self.path)
        self._temporary = temporary
        if temporary:
            weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)

    @property
    def plot(self) -> Plots:
        """Figures of the results, such as `plot.failure_map()`."""
        return Plots(self)

    @cached_property
    def rows(self) -> pd.DataFrame:
        """One row per scenario, variation, case and method; the columns are explained in docs/measures.md."""
        return self._store.results().to_pandas()

    @cached_property
    def traces(self) -> pd.DataFrame:
        """Of the recorded cases, one row per cycle and method."""
        return self._store.traces.read().to_pandas()

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """What was run, by which versions and models, and how long it took."""
        manifest: dict[str, Any] = self._store.read_json(MANIFEST)
        return manifest

    @property
    def methods(self) -> list[str]:
        """Names of the methods that have rows."""
        return sorted(pc.unique(self._store.results(["method"])["method"]).to_pylist())

    def summary(self) -> pd.DataFrame:
        """One row per scenario, variation, site, source and method; see docs/measures.md.

        Example:
            >>> results.summary().set_index("method")["failure_pct"]  # doctest: +SKIP
        """
        return pd.DataFrame(self._store.summary())

    def ensemble(self) -> pd.DataFrame:
        """Where methods were run with several models: one row per method with the median and range over models."""
        return self._store.table(ENSEMBLE_CSV)

    def rivals(self) -> pd.DataFrame:
        """For every two methods run with several models: with how many of them one beats the other."""
        return self._store.table(RIVALS_CSV)

    def traffic(self) -> pd.DataFrame:
        """Where there was living traffic: one row per scenario, variation and method about the traffic as a whole."""
        return pd.DataFrame(self._store.traffic())

    def notes(self) -> list[str]:
        """What was noted in living traffic, a line for each kind of event."""
        return note_lines(self._store)

    def cases(self, where: str | None = None, fails: Sequence[str] = (), passes: Sequence[str] = ()) -> pd.DataFrame:
        """The rows for which a condition holds.

        Example:
            >>> results.cases("failed and method == 'pgm'")  # doctest: +SKIP
            >>> results.cases(fails=["pgm"], passes=["acc"])  # doctest: +SKIP

        Args:
            where: A condition on the columns, as `pandas.DataFrame.query` takes it; all rows, if not given.
            fails: Methods under which the case fails; rows of theirs are given, if there are any.
            passes: Methods under which it neither fails nor is stuck or censored.

        Returns:
            Those rows, numbered anew.

        Raises:
            UserError: The condition cannot be read, names a column that there is not, or a method was not run.
        """
        holds = None if where is None else self._where(where)
        known = self.methods if fails or passes else []
        for name in (*fails, *passes):
            if name not in known:
                raise UserError(f"{self.path}: no method '{name}' in these results{did_you_mean(name, known)}")
        found, gaps, first = [SCHEMA.empty_table()], set[str](), 0
        for rows in self._store.rows.all_batches():
            gaps |= {name for name in rows.column_names if rows[name].null_count}
            chosen = np.ones(len(rows), dtype=bool) if holds is None else holds[first : first + len(rows)]
            if fails or passes:
                chosen = chosen & _agree(rows, fails, passes)
            first += len(rows)
            found.append(rows.filter(pa.array(chosen)))
        return _as_of_all(pa.concat_tables(found), gaps)

    def run_commands(self, rows: pd.DataFrame) -> list[str]:
        """The commands that run the cases of some rows again, one for each."""
        return [run_command(row, self.manifest) for row in rows.to_dict("records")]

    def _where(self, where: str) -> BoolArray:
        """Where a condition holds, shape (rows,): of all rows, as it may ask for a mean over them."""
        if _constant_part(where):
            raise UserError(f"where {where!r}: a part of it names no column; {EXAMPLE}")
        rows = self._store.results(_columns_in(where)).to_pandas()
        try:
            holds = rows.eval(where, engine="python", local_dict={}, global_dict={})
        except pd.errors.UndefinedVariableError as error:
            name = str(error).split("'")[1]
            raise UserError(f"where {where!r}: no column '{name}'{did_you_mean(name, SCHEMA.names)}") from None
        except Exception as error:  # pandas raises whatever its parser and numpy raise
            raise UserError(f"where {where!r}: {' '.join(str(error).split())}; {EXAMPLE}") from None
        if not (isinstance(holds, pd.Series) and pd.api.types.is_bool_dtype(holds)):
            raise UserError(f"where {where!r}: this is no condition; {EXAMPLE}")
        return holds.to_numpy(dtype=bool)

    def compare(self, first: str, second: str, other: Results | None = None) -> pd.DataFrame:
        """Compare two methods on the cases that both were run on.

        Example:
            >>> results.compare("pgm", "acc")  # doctest: +SKIP

        Args:
            first: Method A.
            second: Method B.
            other: Results that B's rows are taken from; these, if not given.

        Returns:
            One row per scenario, variation, site and source: `n` common cases, the failures of each, the cases that
            only one of them fails, McNemar's exact p value (none for a fixed grid, which is no sample), and the
            means of the main measures of both with the mean of the paired differences A - B.

        Raises:
            UserError: One of them was not run, or they have no case in common.
        """
        return compare(self.path, (other or self).path, (first, second))[0].data

    def verify(
        self,
        share: float = 0.05,
        *,
        seed: int = 0,
        data: str | Path | None = None,
        model: str | Path | None = None,
        plugins: Sequence[str | Path] = (),
        jobs: int | None = None,
        tolerance: float | None = None,
    ) -> Verification:
        """Run a share of the rows again in SUMO, in fresh processes, and compare them with what is stored.

        Example:
            >>> print(results.verify(0.1))  # doctest: +SKIP

        Args:
            share: Share of the rows of each scenario, variation and method, above 0 and up to 1.
            seed: Seed of the choice of rows.
            data: As in `merge_cosim.sweep`.
            model: Model file or name; the one of the rows' name, if not given.
            plugins: As in `merge_cosim.sweep`.
            jobs: As in `merge_cosim.sweep`.
            tolerance: Largest difference of a measure, absolute, or relative where the measure is above 1. If not
                given: 1e-4 for rows of the closed form, 0 for others.

        Returns:
            `rows` that were run again, `differences` by column, `beyond` (values beyond the tolerance), and `notes` on
            versions that have changed.

        Raises:
            UserError: What the folder was made from is not here.
        """
        from merge_cosim.sweeps.verify import verify

        return verify(
            self.path,
            share,
            seed,
            find_data(data),
            None if model is None else str(model),
            [Path(plugin) for plugin in plugins],
            jobs or os.cpu_count() or 1,
            tolerance,
        )

    def report(self, file: str | Path | None = None, against: str | None = None) -> Path:
        """Write the report: one HTML page that needs nothing else; its tables go to `tables/` of the result folder.

        Example:
            >>> results.report("out.html")  # doctest: +SKIP

        Args:
            file: The page; `report.html` in the result folder, if not given.
            against: Method that the others are compared with; the sweep's own choice, if not given.

        Returns:
            The page.

        Raises:
            UserError: The folder holds no finished sweep, or not the method to compare with.
        """
        from merge_cosim.report.page import write_report  # with matplotlib, which a sweep need not import

        page = write_report(self.path, against)
        if file is None:
            return page
        target = Path(file)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(page, target)
        return target

    def figures(
        self,
        out: str | Path,
        width_cm: float | None = None,
        font_size: float = 9.0,
        columns: Sequence[str] = (),
    ) -> list[Path]:
        """Write every figure for a paper: SVG, PDF, PNG and its data as CSV; the tables as LaTeX and CSV.

        Example:
            >>> results.figures("paper/figures", width_cm=8.4)  # doctest: +SKIP

        Args:
            out: The folder; the tables go to `tables/` in it.
            width_cm: Width of every figure [cm]; each figure's own, if not given.
            font_size: Size of the type [pt].
            columns: Columns of the tables of outcomes; all, if not given.

        Returns:
            The files.

        Raises:
            UserError: The folder holds no finished sweep, or there is no such column.
        """
        from merge_cosim.report.figures import write_figures

        return write_figures(self.path, Path(out), width_cm, font_size, columns)

    def __len__(self) -> int:
        self._store.check()
        return len(self._store.rows)

    def __repr__(self) -> str:
        from merge_cosim.report.text_table import as_text

        where = "" if self._temporary else f" in {self.path}"
        return f"Results{where}: {len(self):,} rows\n{as_text(self._tables())}"

    def _repr_html_(self) -> str:
        """The table, the verdict, and the interactive charts of the report."""
        from merge_cosim.report.notebook import frame, tables_html
        from merge_cosim.report.page import read_report, report_page

        page = report_page(read_report(self.path), brief=True)
        return tables_html(self._tables()) + frame(page, "Charts of the results")

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str]:
        return {"text/plain": repr(self), "text/html": self._repr_html_()}

    def _tables(self) -> list[ShortTable]:
        from merge_cosim.report.short_table import short_tables, traffic_tables

        return [*short_tables(self.path), *traffic_tables(self.path)]


def _constant_part(condition: str) -> bool:
    """Whether something without a column in it is negated or compared, which pandas takes for a number's bits."""
    pieces: list[list[ast.expr]] = []
    for one in _parsed(condition) or ():  # else pandas raises its own error
        if isinstance(one, ast.UnaryOp) and isinstance(one.op, ast.Not | ast.Invert):
            pieces.append([one.operand])
        elif isinstance(one, ast.Compare):
            pieces += map(list, pairwise([one.left, *one.comparators]))
    return not all(any(_is_column(part) for one in piece for part in ast.walk(one)) for piece in pieces)


def _parsed(condition: str) -> list[ast.AST] | None:
    """All parts of a condition; None where it is not Python's syntax."""
    try:
        return list(ast.walk(ast.parse(condition.strip(), mode="eval")))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None


def _is_column(part: ast.AST) -> bool:
    """Whether it is a name that pandas does not know by itself."""
    return isinstance(part, ast.Name) and part.id not in ("inf", "Inf", "datetime", "Timestamp", "list", "tuple")


def _columns_in(condition: str) -> list[str]:
    """The columns that a condition names; all, where it is not Python's syntax, which pandas extends."""
    parts = _parsed(condition)
    if parts is None:
        return list(SCHEMA.names)
    names = {part.id for part in parts if isinstance(part, ast.Name)}
    return [name for name in SCHEMA.names if name in names] or ["case"]


def _agree(rows: pa.Table, fails: Sequence[str], passes: Sequence[str]) -> BoolArray:
    """The rows of some whole cases that fail under some methods and pass under others, and are of the former."""
    frame = rows.select([*CASE, "method", "failed", "stuck", "censored"]).to_pandas()
    case = frame.groupby(CASE, sort=False).ngroup().to_numpy()
    bad = frame["failed"] | frame["stuck"] | frame["censored"]
    chosen: BoolArray = frame["method"].isin(fails or passes).to_numpy(dtype=bool)
    for holds, names in ((frame["failed"], fails), (~bad, passes)):
        for name in names:
            chosen = chosen & np.isin(case, case[(holds & (frame["method"] == name)).to_numpy(dtype=bool)])
    return chosen


def _as_of_all(rows: pa.Table, gaps: Set[str]) -> pd.DataFrame:
    """Some rows with the types that pandas gives to all of them, where some columns have gaps."""
    frame = rows.to_pandas()
    for name in gaps:
        if not rows[name].null_count:
            kind = rows.schema.field(name).type
            if pa.types.is_boolean(kind) or pa.types.is_integer(kind):
                frame[name] = frame[name].astype(object if pa.types.is_boolean(kind) else float)
    return frame


def load_results(folder: str | Path) -> Results:
    """Read a result folder.

    Example:
        >>> results = mc.load_results("out/first")  # doctest: +SKIP

    Args:
        folder: What `--out` or `out` named.

    Raises:
        UserError: There is no finished sweep, or another version of merge-cosim wrote it.
    """
    results = Results(folder)
    len(results)
    for _ in ResultFolder(results.path).rows.all_batches():
        pass  # damage shows now
    return results
