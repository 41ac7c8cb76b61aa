"""The papers' claims, each with our verdict and its evidence, computed from the results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pandas as pd

from merge_cosim.report.columns import Column, Table
from merge_cosim.report.published import CYCLE_MS
from merge_cosim.results.statistics.paired import mean_difference
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
    columns = [Column("claim", "claim", prose=True), Column("paper", "paper"), Column("verdict", "verdict")]
    columns.append(Column("evidence", "evidence", prose=True))
    return Table.of(pd.DataFrame(rows), columns, "The papers' claims and our verdict")


def _pgm_is_best(evidence: Evidence) -> Verdict:
    lines, leads = [], []
    for scenario in [name for name in evidence.scenarios if name != "designed-3"]:
        rates = _rates(evidence, scenario, (*RIVALS, "pgm"))
        best = str(rates.drop("pgm").idxmin())
        lead = evidence.rate_difference(scenario, best, "pgm")
        leads.append(lead)
        lines.append(
            f"{TESTS[scenario]}: pgm {rates['pgm']:.1f} %, lowest of the rivals {rates[best]:.1f} % ({best}), "
            + (f"pgm's lead {_interval(lead)} points" if any(lead) else "no case on which only one of the two fails")
        )
    return Verdict(_word(leads), "; ".join(lines))


def _ipcb_and_pgm_g_fail_alike(evidence: Evidence) -> Verdict:
    lines, alike = [], []
    for scenario in [name for name in ("designed-1", "designed-2") if name in evidence.scenarios]:
        first, second, p = evidence.discordant(scenario, "ipcb", "pgm-g")
        rates = _rates(evidence, scenario, ("ipcb", "pgm-g"))
        _, low, high = evidence.rate_difference(scenario, "ipcb", "pgm-g")
        alike.append(HOLDS if low >= -ALIKE and high <= ALIKE else FAILS if low > ALIKE or high < -ALIKE else OPEN)
        lines.append(
            f"{TESTS[scenario]}: ipcb {rates['ipcb']:.1f} %, pgm-g {rates['pgm-g']:.1f} %; only ipcb fails in {first} "
            f"cases, only pgm-g in {second}"
            + (f", p = {p:.2g}" if scenario == "designed-1" else "")
            + f"; difference {low:.1f} to {high:.1f} points"
        )
    return Verdict(_all_of(alike), "; ".join(lines))


def _fewest_failures_in_the_middle(evidence: Evidence) -> Verdict:
    rates = evidence.nodes.groupby("nodes")["failure_pct"].mean()
    low, high = rates.loc[: BEST_NODES[0] - 1], rates.loc[BEST_NODES[1] + 1 :]
    middle = rates.loc[BEST_NODES[0] : BEST_NODES[1]]
    leads = [(float(side.min() - middle.min()),) * 3 for side in (low, high)]
    text = (
        f"fewest failures within {BEST_NODES[0]}-{BEST_NODES[1]} nodes {middle.min():.2f} %, with fewer nodes "
        f"{low.min():.2f} % (at {low.idxmin():g}), with more {high.min():.2f} % (at {high.idxmin():g}); over "
        f"all numbers of nodes from {rates.min():.2f} to {rates.max():.2f} %"
    )
    return Verdict(_word(leads), text)


def _i80_is_easier(evidence: Evidence) -> Verdict:
    if "i80-replay" not in evidence.scenarios:
        return Verdict(OPEN, "no I-80 pairs of this source")
    lines, leads = [], []
    for method in (*RIVALS, "pgm"):
        columns = ["failure_pct", "ci_low_pct", "ci_high_pct"]
        sites = ("us101-replay", "i80-replay")
        us101, i80 = (evidence.outcome(name).loc[method, columns].to_numpy(dtype=float) for name in sites)
        rate, low, high = us101 - i80[[0, 2, 1]]
        leads.append((float(rate), float(low), float(high)))
        lines.append(f"{method} {us101[0]:.1f} against {i80[0]:.1f} %")
    return Verdict(_word(leads), f"US-101 against I-80: {'; '.join(lines)} (judged by Wilson's intervals)")


def _pgm_drives_most_like_the_human(evidence: Evidence) -> Verdict:
    rows = evidence.cases("us101-replay").drop_duplicates(["case", "method"])
    distance = rows.pivot(index="case", columns="method", values="human_station_rms_m").astype(float)
    cars = rows.drop_duplicates("case").set_index("case")["car"]
    means = distance[[*RIVALS, "pgm"]].mean().sort_values()
    nearest = str(means.drop("pgm").idxmin())
    mean, (low, high) = mean_difference(distance[nearest], distance["pgm"], cars.reindex(distance.index))
    lead = (mean, mean if low is None else low, mean if high is None else high)
    lines = [f"{method} {value:.2f} m" for method, value in means.items()]
    text = (
        f"mean RMS difference of station to the human: {', '.join(lines)}; pgm's lead on {nearest} {_interval(lead)} m"
    )
    return Verdict(_word([lead]), text)


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


Lead = tuple[float, float, float]
"""By how much a claim is right (positive) or wrong: the estimate, and the low and high end of its interval."""


def _word(leads: Sequence[Lead]) -> str:
    """Judge a claim that needs every lead to be positive."""
    return _all_of([HOLDS if low > 0 else FAILS if high < 0 else OPEN for _, low, high in leads])


def _all_of(words: Sequence[str]) -> str:
    """Holds where all parts hold, does not where one does not, else undecided."""
    return FAILS if FAILS in words else OPEN if OPEN in words else HOLDS


def _interval(lead: Lead) -> str:
    return f"{lead[0]:.2f} ({lead[1]:.2f} to {lead[2]:.2f})"


def _rates(evidence: Evidence, scenario: str, methods: tuple[str, ...]) -> pd.Series:
    rates: pd.Series = evidence.outcome(scenario).loc[list(methods), "failure_pct"].astype(float)
    return rates
