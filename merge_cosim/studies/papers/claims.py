"""The papers' claims, each with our verdict and its evidence, computed from the results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pandas as pd

from merge_cosim.report.columns import Column, Table
from merge_cosim.report.published import CYCLE_MS
from merge_cosim.studies.papers.evidence import Evidence
from merge_cosim.studies.papers.tables import TESTS, VALIDITY_STEPS, validity

RIVALS = ("acc", "slot", "ipcb", "pgm-g")
"""What PGM is compared with (Dong, Dolan, Litkouhi 2017, Table II)."""
ALIKE = 0.6
"""Failure rates no further apart than this [points] are alike: those of the paper are 0.9 and 0.9, 1.2 and 1.8 %."""
BEST_NODES = (52, 73)
"""Numbers of speed nodes between which the failures are said to be fewest."""
HOLDS, FAILS, OPEN = "holds", "does not hold", "undecided"


@dataclass(frozen=True)
class Verdict:
    """Our verdict on a claim.

    Attributes:
        word: `holds`, `does not hold` or `undecided`.
        evidence: The figures that it rests on.
    """

    word: str
    evidence: str


@dataclass(frozen=True)
class Claim:
    """A claim of a paper.

    Attributes:
        text: The claim.
        paper: The paper that claims it.
        judge: Comes to a verdict.
    """

    text: str
    paper: str
    judge: Callable[[Evidence], Verdict]


def claims_table(evidence: Evidence) -> Table:
    """Every claim with our verdict on it."""
    rows = []
    for claim in CLAIMS:
        verdict = claim.judge(evidence)
        rows.append({"claim": claim.text, "paper": claim.paper, "verdict": verdict.word, "evidence": verdict.evidence})
    columns = [Column("claim", "claim"), Column("paper", "paper"), Column("verdict", "verdict")]
    columns.append(Column("evidence", "evidence", prose=True))
    return Table.of(pd.DataFrame(rows), columns, [False] * len(rows), "The papers' claims and our verdict")


def _pgm_is_best(evidence: Evidence) -> Verdict:
    lines, leads = [], []
    for scenario in _published_tests(evidence):
        rates = _rates(evidence, scenario, (*RIVALS, "pgm"))
        others = rates.drop("pgm")
        leads.append(float(others.min() - rates["pgm"]))
        best = ", ".join(others.index[others == others.min()])
        lines.append(f"{TESTS[scenario]}: pgm {rates['pgm']:.1f} %, lowest of the rivals {others.min():.1f} % ({best})")
    return Verdict(_word(leads), "; ".join(lines))


def _ipcb_and_pgm_g_fail_alike(evidence: Evidence) -> Verdict:
    lines, alike = [], []
    for scenario in [name for name in ("designed-1", "designed-2") if name in evidence.scenarios]:
        first, second, p = evidence.discordant(scenario, "ipcb", "pgm-g")
        rates = _rates(evidence, scenario, ("ipcb", "pgm-g"))
        alike.append(abs(rates["ipcb"] - rates["pgm-g"]) <= ALIKE)
        lines.append(
            f"{TESTS[scenario]}: ipcb {rates['ipcb']:.1f} %, pgm-g {rates['pgm-g']:.1f} %; only ipcb fails in {first} "
            f"cases, only pgm-g in {second}" + (f", p = {p:.2g}" if scenario == "designed-1" else "")
        )
    return Verdict(HOLDS if all(alike) else FAILS, "; ".join(lines))


def _fewest_failures_in_the_middle(evidence: Evidence) -> Verdict:
    rates = evidence.nodes.groupby("nodes")["failure_pct"].mean()
    low, high = rates.loc[: BEST_NODES[0] - 1], rates.loc[BEST_NODES[1] + 1 :]
    middle = rates.loc[BEST_NODES[0] : BEST_NODES[1]]
    leads = [float(side.min() - middle.min()) for side in (low, high)]
    text = (
        f"fewest failures within {BEST_NODES[0]}-{BEST_NODES[1]} nodes {middle.min():.2f} %, with fewer nodes "
        f"{low.min():.2f} % (at {low.idxmin():g}), with more {high.min():.2f} % (at {high.idxmin():g}); over "
        f"all numbers of nodes from {rates.min():.2f} to {rates.max():.2f} %"
    )
    return Verdict(_word(leads), text)


def _i80_is_easier(evidence: Evidence) -> Verdict:
    if "i80-replay" not in evidence.scenarios:
        return Verdict(OPEN, "no I-80 pairs of this source")
    methods = (*RIVALS, "pgm")
    us101, i80 = (_rates(evidence, name, methods) for name in ("us101-replay", "i80-replay"))
    lines = [f"{method} {us101[method]:.1f} against {i80[method]:.1f} %" for method in methods]
    return Verdict(_word((us101 - i80).tolist()), f"US-101 against I-80: {'; '.join(lines)}")


def _pgm_drives_most_like_the_human(evidence: Evidence) -> Verdict:
    rows = evidence.outcome("us101-replay")
    distance = rows.loc[[*RIVALS, "pgm"], "human_station_rms_m"].astype(float)
    lines = [f"{method} {value:.2f} m" for method, value in distance.sort_values().items()]
    text = f"mean RMS difference of station to the human: {', '.join(lines)}"
    return Verdict(HOLDS if distance.idxmin() == "pgm" else FAILS, text)


def _graph_and_mixture_help(evidence: Evidence) -> Verdict:
    table = validity(evidence).data
    lines, holds = [], []
    for row in table.to_dict("records"):
        rates = [row[f"{method}_pct"] for method in VALIDITY_STEPS]
        holds.append(rates[0] > rates[1] > rates[2])
        lines.append(f"{row['data']} ({row['pairs']} pairs): " + " / ".join(f"{rate:.1f} %" for rate in rates))
    return Verdict(HOLDS if all(holds) else FAILS, "without FG and GMM / without GMM / with both: " + "; ".join(lines))


def _rivals_fail_twice_as_often(evidence: Evidence) -> Verdict:
    lines, holds = [], []
    for scenario in [name for name in ("us101-replay", "i80-replay") if name in evidence.scenarios]:
        rates = _rates(evidence, scenario, (*RIVALS, "fg-gmm"))
        rivals = rates.drop("fg-gmm")
        holds.append(bool((rivals > 2 * rates["fg-gmm"]).all()))
        parts = [f"{method} {rate:.1f} %" for method, rate in rivals.items()]
        lines.append(f"{TESTS[scenario]}: fg-gmm {rates['fg-gmm']:.1f} %, {', '.join(parts)}")
    return Verdict(
        HOLDS if all(holds) else FAILS,
        "; ".join(lines) + "; in the paper's own table slot (10.4 %) is below twice fg-gmm (7.0 %) on I-80",
    )


def _pgm_takes_little_time(evidence: Evidence) -> Verdict:
    rows = evidence.outcome(evidence.scenarios[0])
    alone, batch = rows.loc["pgm", ["cycle_us_single", "cycle_us"]].to_numpy(dtype=float)
    theirs = 1000 * CYCLE_MS["pgm"]
    text = (
        f"{alone:.0f} µs per update alone, {batch:.2f} µs in a batch (published {theirs:.0f} µs); it reads speeds and "
        f"stations, no acceleration"
    )
    return Verdict(HOLDS if alone < theirs else FAILS, text)


CLAIMS = (
    Claim("PGM has the lowest failure rate in every test", "PGM", _pgm_is_best),
    Claim("iPCB and PGM-G fail alike in Designed Tests I and II", "PGM", _ipcb_and_pgm_g_fail_alike),
    Claim("Failures fall until 52 to 73 speed nodes and rise after", "PGM", _fewest_failures_in_the_middle),
    Claim("I-80 is easier, because its ramp is longer", "PGM", _i80_is_easier),
    Claim("PGM drives most like the human host", "PGM-LQR", _pgm_drives_most_like_the_human),
    Claim("The FG takes 8 points off the failure rate, the GMM another 7", "FG-GMM", _graph_and_mixture_help),
    Claim("All rivals fail more than twice as often as FG-GMM", "FG-GMM", _rivals_fail_twice_as_often),
    Claim("PGM needs no acceleration of other cars and little time", "PGM", _pgm_takes_little_time),
)
"""The papers' claims; PGM: Dong, Dolan, Litkouhi 2017; FG-GMM: Lyu, Dong, Dolan 2020."""


def _published_tests(evidence: Evidence) -> list[str]:
    return [name for name in evidence.scenarios if name != "designed-3"]


def _word(leads: Sequence[float]) -> str:
    """Holds where every lead is positive, does not where one is negative, undecided where it is a tie."""
    return HOLDS if min(leads) > 0 else FAILS if min(leads) < 0 else OPEN


def _rates(evidence: Evidence, scenario: str, methods: tuple[str, ...]) -> pd.Series:
    rates: pd.Series = evidence.outcome(scenario).loc[list(methods), "failure_pct"].astype(float)
    return rates
