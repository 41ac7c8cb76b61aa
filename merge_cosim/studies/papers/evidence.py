"""What the studies of a reproduction found, in one place for tables, figures and claims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from merge_cosim.report.tables import ranges, summary_frame
from merge_cosim.results.statistics.comparison import clusters_of, compare
from merge_cosim.results.statistics.paired import mean_difference
from merge_cosim.results.statistics.summary import ALL_SITES, ALL_STARTS, is_sample
from merge_cosim.results.store import BELIEF_CSV, ResultFolder
from merge_cosim.studies.reproduction import DESIGNED, MODEL_SWEEP, NODE_SWEEP, PAIRS, Study


@dataclass(frozen=True)
class Evidence:
    """Results of the studies that rest on one source of pairs, and of the designed ones.

    Attributes:
        source: `surrogate` or `ngsim`.
        model: Name of the model that was trained on this source.
        results: Result rows of the tests, one per scenario, case and method.
        summary: Summary rows of the tests, one per scenario, site and method.
        nodes: Summary rows of the node sweep, with the column `nodes`.
        beliefs: How good beliefs were by distance, one row per test, site, method and gate.
        by_model: Summary rows of Designed Test II, one per method and model of the ensemble.
    """

    source: str
    model: str
    results: pd.DataFrame
    summary: pd.DataFrame
    nodes: pd.DataFrame
    beliefs: pd.DataFrame
    by_model: pd.DataFrame

    @property
    def scenarios(self) -> list[str]:
        """The tests that were run, the papers' order."""
        known = ("us101-replay", "i80-replay", "designed-1", "designed-2", "designed-3")
        return [name for name in known if name in set(self.summary["scenario"])]

    def outcome(self, scenario: str) -> pd.DataFrame:
        """Summary rows of a test, one per method (index); over all sites where it has several."""
        rows = self.summary[self.summary["scenario"] == scenario]
        if (rows["site"] == ALL_SITES).any():
            rows = rows[rows["site"] == ALL_SITES]
        return rows.set_index("method")

    def cases(self, scenario: str) -> pd.DataFrame:
        """Result rows of a test."""
        return self.results[self.results["scenario"] == scenario]

    def rate_difference(self, scenario: str, one: str, other: str) -> tuple[float, float, float]:
        """Failure rate of `one` minus that of `other` [points] on the cases that both carry to the end, low and high.

        Over a sample the ends are the bootstrap's 95 % interval over merging cars, over a fixed grid the range over the
        models of the ensemble.
        """
        rows = self.cases(scenario)
        kept = rows[~rows["censored"] & rows["method"].isin((one, other))].drop_duplicates(["case", "method"])
        failed = (100.0 * kept.pivot(index="case", columns="method", values="failed").astype(float)).dropna()
        if is_sample(kept):
            clusters = clusters_of(kept[kept["method"] == one]).set_axis(kept.loc[kept["method"] == one, "case"])
            mean, (low, high) = mean_difference(failed[one], failed[other], clusters.reindex(failed.index))
            return mean, mean if low is None else low, mean if high is None else high
        mean = float((failed[one] - failed[other]).mean())
        rates = self.by_model.pivot(index="model", columns="method", values="failure_pct").astype(float)
        rates = rates.reindex(columns=[one, other])
        for method in (one, other):  # a method that learns nothing is the same with every model
            rates[method] = rates[method].fillna(float(failed[method].mean()))
        spread = rates[one] - rates[other]
        return mean, min(mean, float(spread.min())), max(mean, float(spread.max()))

    def discordant(self, scenario: str, one: str, other: str) -> tuple[int, int, float]:
        """Cases in which only `one` fails, only `other` fails, and the p value of McNemar's exact test."""
        rows = self.cases(scenario)
        found = compare(rows[rows["method"] == one], rows[rows["method"] == other], other, is_sample=True)
        return found["only_this_fails"], found["only_other_fails"], found["mcnemar_p"]


def gather(studies: Sequence[Study], out: Path) -> list[Evidence]:
    """Read the finished studies, one `Evidence` per source of pairs."""
    by_name = {study.name: ResultFolder(out / study.name) for study in studies}
    found = []
    for study in (one for one in studies if one.kind == PAIRS):
        names = [DESIGNED, study.name]
        nodes = _summary(by_name[f"{NODE_SWEEP}-{study.source}"])
        nodes["nodes"] = pd.to_numeric(nodes["variation"].str.partition("=")[2], errors="coerce")
        found.append(
            Evidence(
                source=study.source,
                model=Path(str(study.request.model)).stem,
                results=pd.concat([by_name[name].results().to_pandas() for name in names], ignore_index=True),
                summary=pd.concat([_summary(by_name[name]) for name in names], ignore_index=True),
                nodes=nodes.dropna(subset="nodes").sort_values("nodes"),
                beliefs=pd.concat([_beliefs(out / name) for name in names], ignore_index=True),
                by_model=_summary(by_name[f"{MODEL_SWEEP}-{study.source}"]),
            )
        )
    return found


def _beliefs(folder: Path) -> pd.DataFrame:
    if not (folder / BELIEF_CSV).is_file():  # no case of the study has a label
        return pd.DataFrame()
    rows = pd.read_csv(folder / BELIEF_CSV, keep_default_na=False, na_values=[""])
    return rows[(rows["start"] == ALL_STARTS) & rows["variation"].isna()]


def _summary(folder: ResultFolder) -> pd.DataFrame:
    frame = summary_frame(folder.summary())
    low, high = (frame[f"distance_{end}_m"] for end in ("low", "high"))
    frame["distance_interval_m"] = ranges(low, high)
    return frame
