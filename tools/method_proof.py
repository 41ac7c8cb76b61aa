"""Bring the page of `interactive` up to date: python tools/method_proof.py [--data DIR] [--only ...] [--again ...].

The blocks `<!-- proof: NAME -->` ... `<!-- end -->` of docs/methods/interactive.md are tables of sweeps, each with the
command that gives the same figures. `<!-- choice: CASE -->` shows why policies were chosen in a case of Designed Test
III, `<!-- escapes: all -->` how often there is an escape, `<!-- losses: all -->` when the failed cases lost theirs,
`<!-- short: all -->` what the tables say about `interactive` beside the best of the others.
Without --data, tables of logged cars stay as they are; with --again only the rows of these methods are made anew.
"""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from blocks import BLOCK, DOCS, fill_page, filled, page_parser, table

import merge_cosim as mc
from merge_cosim.controllers.rollout import POLICIES, Rollout
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.estimators.driver_types import DRIVER_TYPES
from merge_cosim.estimators.interactive import Interactive
from merge_cosim.simulation.host_driver import HostDriver

RIVALS = ["interactive", "acc", "slot", "slot-time", "pgm", "fg-gmm", "dbn-pf", "ipcb"]
NARROW = {"speed_limit": 12, "encounters.length": 7}
GRID = "host_offset", "host_speed", "merging_speed"
SEED = "encounters.seed", "merging.seed"
SHORT = {
    "designed-2": {f"encounters.{name}.step": step for name, step in zip(GRID, (10, 12, 12), strict=True)},
    "designed-3": {"encounters.count": 20},
    "shifted": {"encounters.count": 20},
}
OTHERS = ["acc", "slot", "slot-time", "pgm", "ipcb"]
LOSSES: list[tuple[str, dict[str, Any]]] = [
    *(("designed-3", dict.fromkeys(SEED, seed)) for seed in range(10)),
    *((scenario, {}) for scenario in ("shifted-idm", "shifted-late", "shifted-never-look", "us101-replay")),
]
PAGE = "methods/interactive.md"
COSTS = ["delay [s]", "D [m]", "hardest braking [m/s²]", "jerk [m/s³]"]


@dataclass(frozen=True)
class Study:
    """Sweeps whose rows are laid together.

    Attributes:
        scenarios: Scenarios, or a family.
        methods: Methods.
        settings: Settings of each sweep, one sweep after the other.
        logged: It needs real data.
        world: In which world it is run.
    """

    scenarios: list[str]
    methods: list[str]
    settings: list[dict[str, Any]] = field(default_factory=lambda: [{}])
    logged: bool = False
    world: str = "closed-form"

    def command(self, settings: dict[str, Any]) -> str:
        """The same sweep on the command line."""
        words = ["merge-cosim", "sweep", *self.scenarios, "--method", ",".join(self.methods), "--world", self.world]
        words += [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
        return shlex.join([*words, "--out", "out/proof"])


PLANNERS = ["interactive+acc", "interactive+pcb", "slot-time+rollout", "pgm+rollout", "dbn-pf+rollout", "ipcb+rollout"]
ABLATIONS: list[dict[str, Any]] = [
    {},
    {"rollout.reacts": False},
    {"rollout.commitment": 0.0},
    {"rollout.escape": False},
    {"rollout.tolerated_risk": 0.0},
    {"rollout.risk_memory": 0.0},
    {"rollout.overlap": 1000.0},
    {"rollout.spread_rate": 0.0},
    {"rollout.escape_grades": 1},
    {"rollout.last_overlap": 7.0},
]
STRICT: dict[str, Any] = {"rollout.tolerated_risk": 0.0}
FASTEST = STRICT | {f"rollout.{cost}": 0.0 for cost in ("overlap", "last_overlap", "effort", "sudden", "commitment")}
"""Only the time to the goal has a cost: what keeping the escape takes by itself."""
FRONT: list[dict[str, Any]] = [
    STRICT,
    *({"rollout.tolerated_risk": risk} for risk in (0.003, 0.01, 0.03, 0.1, 1.0)),
    STRICT | {"rollout.escape_braking": 3.0, "rollout.escape_acceleration": 2.0},
    FASTEST,
]
ERRORS = [("speed_sigma", 0.5), ("station_sigma", 1.0), ("delay", 0.3)]
SENSING: list[dict[str, Any]] = [
    {f"sensing.{name}": size for name, size in some} for some in (*[[e] for e in ERRORS], ERRORS)
]
LATE = [given for given in SENSING if "sensing.delay" in given]
STUDIES = {
    "designed": Study(["designed-2"], RIVALS),
    "narrow": Study(["designed-2"], RIVALS, [NARROW]),
    "designed-1": Study(["designed-1"], RIVALS, logged=True),
    "hidden": Study(["designed-3"], [*RIVALS, "oracle-label", "always-go", "always-yield", "oracle-best"]),
    "seeds": Study(["designed-3"], ["interactive"], [dict.fromkeys(SEED, seed) for seed in range(1, 10)]),
    "shifted": Study(["shifted"], ["interactive", *OTHERS]),
    "shifted-seeds": Study(["shifted"], ["interactive", "slot-time", "ipcb"], [{"encounters.seed": 5}]),
    "replay": Study(["us101-replay"], [*RIVALS, "human"], logged=True),
    "scene": Study(["us101-scene"], [*RIVALS, "human"], logged=True, world="sumo"),
    "sensing": Study(["designed-3"], ["interactive", *OTHERS], SENSING),
    "compensated": Study(
        ["designed-3"], ["interactive", *OTHERS], [given | {"sensing.compensated": True} for given in LATE]
    ),
    "unstamped": Study(["designed-3"], ["interactive"], [given | {"sensing.stamped": False} for given in LATE]),
    "planners": Study(["designed-3"], ["interactive", *PLANNERS, "oracle-label+rollout"]),
    "ablations": Study(["designed-3"], ["interactive"], ABLATIONS),
    "front": Study(["designed-3"], ["interactive"], FRONT),
}
TOLD = "designed", "hidden", "replay"
"""Studies that the page begins with."""
WHOLE = [*STUDIES, "choice", "escapes", "losses"]


def shown(settings: dict[str, Any]) -> str:
    """Settings in a cell."""
    return ", ".join(f"`{key}={value}`" for key, value in settings.items())


def costs(row: Any) -> list[str]:
    """The cells of `COSTS` of a summary row."""
    return [f"{row.delay_s:.3f}", f"{row.distance_m:.1f}", f"{row.hardest_braking:.2f}", f"{row.mean_jerk:.2f}"]


def proof(name: str, short: bool, data: Path | None, again: Sequence[str] = ()) -> str | None:
    """The table of one study; with `again` only the rows of these methods are new."""
    study = STUDIES[name]
    if study.logged and data is None:
        return None
    methods = [method for method in study.methods if not again or method in again]
    head = ["scenario", "method", "settings", "n", "failed", "stuck", "failed or stuck [%]", *COSTS]
    rows = []
    for settings in study.settings:
        given = settings | (SHORT.get(study.scenarios[0], {}) if short else {})
        found = mc.sweep(
            study.scenarios, methods, settings=given, data=data, world=study.world, progress=False
        ).summary()
        for row in found.sort_values("scenario", kind="stable").itertuples():
            interval = f"{row.failed_or_stuck_pct:.2f}"
            if pd.notna(row.failed_or_stuck_low_pct):
                interval += f" ({row.failed_or_stuck_low_pct:.2f} to {row.failed_or_stuck_high_pct:.2f})"
            rows.append(
                [
                    row.scenario + (f" ({row.source})" if study.logged else ""),
                    row.method,
                    shown(settings),
                    str(row.n),
                    str(row.failures),
                    str(row.stuck),
                    interval,
                    *costs(row),
                ]
            )
    if not any(row[2] for row in rows):
        head, rows = head[:2] + head[3:], [row[:2] + row[3:] for row in rows]
    if again:
        order = [shown(settings) for settings in study.settings]
        at = head.index("settings") if "settings" in head else None
        page = rows_of((DOCS / PAGE).read_text(encoding="utf-8"), name)
        rows += [list(row.values()) for row in page if row["method"] not in again]
        rows.sort(key=lambda row: (0 if at is None else order.index(row[at]), *row[: len(head) - 8]))
    return f"`{study.command(study.settings[0])}`\n\n{table(head, rows, left=len(head) - 8)}"


def choice(case: str) -> str:
    """What each policy costs against each driver, every second of a case of Designed Test III."""
    seed = int(case.split("-")[1])
    settings = dict.fromkeys(SEED, seed)
    run = mc.run("designed-3", case, "interactive", settings=settings, world="closed-form")
    driver = HostDriver(Interactive(), Rollout())
    driver.start(1, Setting())
    driver.reset(np.zeros(1, np.int64), np.zeros(1, np.int64), np.zeros(1, np.uint64))
    text = ""
    for k, row in enumerate(run.trace.itertuples()):
        cars = row.host_station_m, row.host_speed_m_s, row.merging_station_m, row.merging_speed_m_s, 5.0, 5.0
        seen = Observation(*(np.array([value]) for value in cars))
        if seen.merging_in_lane[0]:
            break
        driver.decide(seen)
        planner = driver.controller
        if k % 10:
            continue
        belief = planner.last_belief[0]
        text += f"{k / 10:.0f} s, host at {cars[0]:.0f} m and {cars[1]:.1f} m/s, merging car at {cars[2]:.0f} m and "
        text += f"{cars[3]:.1f} m/s; driven: **{POLICIES[planner.last_policy[0]]}**\n\n"
        rows = [
            [
                name,
                *(f"{value:.2f}" for value in planner.last_costs[0, number]),
                f"{planner.last_costs[0, number] @ belief:.2f}",
            ]
            for number, name in enumerate(POLICIES)
        ]
        head = [
            "policy",
            *(f"{kind} ({share:.2f})" for kind, share in zip(DRIVER_TYPES, belief, strict=True)),
            "expected",
        ]
        text += table(head, rows) + "\n"
    return text


def traced(scenario: str, kept: str, settings: dict[str, Any], data: Path | None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Rows and traces of `interactive`; a trace's first cycle tells whether an escape existed at the start."""
    found = mc.sweep(
        scenario, "interactive", settings=settings, traces=kept, data=data, world="closed-form", progress=False
    )
    return found.rows, found.traces


def escapes(short: bool) -> str:
    """How often there is an escape in Designed Test III, and who fails with and without one at the start."""
    rows = []
    for settings in STRICT, {}:
        given = settings | (SHORT["designed-3"] if short else {})
        cases, cycles = traced("designed-3", "all", given, None)
        share = cycles["escape_share"].dropna()
        starts = cycles.groupby("case")["escape_share"].first() == 1.0
        failed = cases.set_index("case")["failed"].astype(bool).reindex(starts.index)
        rows.append(
            [
                shown(settings) or "as frozen",
                *(f"{100 * part.mean():.1f}" for part in (share == 1.0, (share < 1.0) & (share > 0.0), share == 0.0)),
                *(f"{failed[part].sum()} of {part.sum()}" for part in (starts, ~starts)),
            ]
        )
    head = ["settings", "cycles with an escape [%]", "within narrowed bounds [%]", "without [%]"]
    return table([*head, "failed of those with an escape at the start", "of those without"], rows)


def losses(short: bool, data: Path | None) -> str | None:
    """When each failed case lost its escape."""
    if data is None:
        return None
    rows = []
    for scenario, settings in LOSSES:
        given = settings | ({"encounters.count": 20} if short and scenario != "us101-replay" else {})
        cases, cycles = traced(scenario, "failed", given, data if scenario == "us101-replay" else None)
        failed = cases[cases["failed"].astype(bool)]
        for case, one in cycles[cycles["case"].isin(failed["case"])].groupby("case", sort=False):
            share, time = one["escape_share"].to_numpy(), one["time_s"].to_numpy()
            last = (f"{time[there].max():.1f}" if there.any() else "-" for there in (share == 1.0, share > 0.0))
            label = str(failed.set_index("case")["label"][case]) or "-"
            rows.append([scenario, str(case), label, f"{share[0]:.2f}", *last, f"{time.max():.1f}"])
    head = ["scenario", "case", "label", "share of the bounds at the start", "last escape [s]"]
    return table([*head, "last within narrowed bounds [s]", "failed [s]"], rows, left=3)


def rows_of(page: str, name: str) -> list[dict[str, str]]:
    """The table of a study on a page, by the names in its head."""
    (block,) = (one[0] for one in BLOCK.finditer(page) if (one["kind"], one["argument"]) == ("proof", name))
    head, _, *rows = [line.strip("| ").split(" | ") for line in block.splitlines() if line[:1] == "|"]
    return [dict(zip(map(str.strip, head), map(str.strip, row), strict=True)) for row in rows]


def in_short(page: str) -> str:
    """What the tables of a page say about `interactive`, beside the method that estimates and fails or waits least."""
    text = ""
    for name in TOLD:
        for scenario, rows in groupby(rows_of(page, name), lambda row: row["scenario"]):
            ours, *others = sorted(rows, key=lambda row: row["method"] != "interactive")
            others = [row for row in others if row["method"] in RIVALS]
            fewest = min(others, key=lambda row: (_missed(row), float(row["delay [s]"])))
            fastest = min(others, key=lambda row: float(row["delay [s]"]))
            text += f"- {scenario}: {_missed(ours)} of {ours['n']} failed or stuck, mean delay {ours['delay [s]']} s. "
            text += f"Fewest of the others: {fewest['method']} with {_missed(fewest)} of {fewest['n']} and "
            text += (
                f"{fewest['delay [s]']} s; least delay of the others: {fastest['delay [s]']} s ({fastest['method']}).\n"
            )
    return text


def _missed(row: Mapping[str, str]) -> int:
    return int(row["failed"]) + int(row["stuck"])


def main(argv: Sequence[str] | None = None) -> None:
    """Fill the page's blocks."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, help="folder with real NGSIM files")
    parser.add_argument("--only", nargs="*", choices=WHOLE, help="blocks to fill; all, if not given")
    parser.add_argument("--again", nargs="*", default=[], help="methods whose rows are made anew; all, if not given")
    given = parser.parse_args(argv)
    wanted = given.only or WHOLE

    def proof_or_stay(name: str) -> str | None:
        return proof(name, given.short, given.data, given.again) if name in wanted else None

    kinds = {
        "proof": proof_or_stay,
        "choice": lambda case: choice(case) if "choice" in wanted else None,
        "escapes": lambda _: escapes(given.short) if "escapes" in wanted else None,
        "losses": lambda _: losses(given.short, given.data) if "losses" in wanted else None,
    }
    fill_page(PAGE, given.docs, kinds)
    page = given.docs / PAGE
    text = page.read_text(encoding="utf-8")
    page.write_text(filled(text, {"short": lambda _: in_short(text)}), encoding="utf-8")


if __name__ == "__main__":
    main()
