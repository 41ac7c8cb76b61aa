"""Full-scene replay in numbers: python tools/scenes_page.py --data DIR --out OUT fills the tables of docs/scenes.md.

The page is written by hand but for its blocks `<!-- table: NAME -->` ... `<!-- end -->`. OUT gets the sweeps they rest
on; one that is there already and the same is not run again. Beside `full_scene` as shipped, its variations are run.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from blocks import fill_page, page_parser, table

from merge_cosim.controllers.acc import Acc
from merge_cosim.results.store import SCENES_CSV, ResultFolder
from merge_cosim.simulation.leader import LeaderRule
from merge_cosim.sweeps.cases import AS_IN_A_SWEEP, LoggedCases
from merge_cosim.sweeps.plan import SweepRequest, plan
from merge_cosim.sweeps.sweep import sweep
from merge_cosim.sweeps.task import Task
from merge_cosim.sweeps.worker_session import WorkerSession

METHODS = ("acc", "slot", "pgm", "fg", "ipcb", "always-go", "always-yield")
ALONE, LOG, RELEASED, BLIND = "the pair alone", "log", "released", "log, leader not heeded"
RUNS = {
    ("us101-replay", ""): ALONE,
    ("us101-scene", "full_scene.heed_leader=False"): BLIND,
    ("us101-scene", ""): LOG,
    ("us101-scene", "full_scene.others=released"): RELEASED,
}
"""What is compared, by scenario and variation."""
SHORT = {"encounters.fraction": 0.97}
"""Settings of the short mode: most pairs are left for training, so that few are tested."""


def kind(case: str) -> str:
    """Which kind of recording a case comes from."""
    return "episodes" if case.startswith("episode") else "fragments"


def run_all(base: SweepRequest, out: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Result rows of all runs, and facts of their scenes, with the columns `run` and `kind`."""
    variations = [("full_scene.others", ["released"]), ("full_scene.heed_leader", [False])]
    rows, facts = [], []
    for name, varied in (("us101-replay", []), ("us101-scene", variations)):
        sweep(replace(base, scenarios=[name], variations=varied), out / name, resume=True, overwrite=True)
        rows.append(ResultFolder(out / name).results().to_pandas())
        if varied:
            facts.append(pd.read_csv(out / name / SCENES_CSV, keep_default_na=False))
    return _joined(rows, "case"), _joined(facts, "scene")


def _joined(parts: list[pd.DataFrame], case: str) -> pd.DataFrame:
    found = pd.concat(parts)
    runs = [RUNS[key] for key in zip(found["scenario"], found["variation"], strict=True)]
    return found.assign(run=runs, kind=found[case].map(kind))


def by_method(frame: pd.DataFrame, runs: tuple[str, ...], cell: Callable[[pd.DataFrame], str], what: str = "") -> str:
    """One row per method, one column per kind of recording and run."""
    columns = [(one, run) for one in sorted(set(frame["kind"]), reverse=True) for run in runs]  # fragments first
    groups = dict(list(frame.groupby(["method", "kind", "run"])))
    methods = [method for method in METHODS if method in set(frame["method"])]
    lines = [[method, *(cell(groups[method, *column]) for column in columns)] for method in methods]
    return table([what, *(f"{one}: {run}" for one, run in columns)], lines)


def failures(rows: pd.DataFrame) -> str:
    """Failures, of them those by hitting the leader, of the cases that are not censored."""
    by_leader = int((rows["failure_kind"] == "host_into_leader").sum())
    return f"{int(rows['failed'].sum())}{f' ({by_leader})' if by_leader else ''} of {int((~rows['censored']).sum())}"


def means(rows: pd.DataFrame) -> str:
    """Mean delay and hardest braking."""
    return f"{rows['delay_s'].mean():.1f} / {rows['hardest_braking'].mean():.1f}"


def gaps(rows: pd.DataFrame) -> str:
    """Median and smallest of the smallest gaps to leader and follower."""
    found = [rows[name].dropna() for name in ("min_leader_gap_m", "min_follower_gap_m")]
    return " / ".join(f"{gap.median():.1f} ({gap.min():.1f})" for gap in found)


def through(facts: pd.DataFrame) -> str:
    """Cars that drove into the host, and scenes with such."""
    return f"{int(facts['driven_through'].sum())} in {int((facts['driven_through'] > 0).sum())}"


def handed(facts: pd.DataFrame) -> str:
    """Cars handed to SUMO, and kept out, per scene."""
    return f"{facts['released'].mean():.1f} / {facts['blocked'].mean():.1f}"


def replay(base: SweepRequest) -> Task:
    """All cases."""
    (task,) = plan(replace(base, scenarios=["us101-scene"], methods=["acc"]))
    return task


def starts(task: Task) -> str:
    """Time gaps of the hosts to their leaders at the start."""
    found: dict[str, list[float]] = {"fragments": [], "episodes": []}
    encounters = task.cases.encounters
    assert encounters is not None
    (opening,) = task.cases.worlds(task.ramp, 0, WorkerSession(), AS_IN_A_SWEEP, human=False)
    with opening as (world, _, _):
        setting = task.setting
        world.start(encounters, setting, task.scenario.test, LeaderRule(Acc(), setting), 0)
        for number in range(len(task)):
            world.place(np.array([0]), np.array([number]))
            gap = world.leader[0, 0] / float(encounters.host_speed[number])
            found[kind(task.case(number))].append(gap)
            world.end_scene()
    lines = []
    for name, gaps in ((name, gaps) for name, gaps in found.items() if gaps):
        led = np.array([gap for gap in gaps if np.isfinite(gap)])
        below = [str(int((led < limit).sum())) for limit in (1.0, 1.5)]
        lines.append([name, str(len(gaps)), str(len(led)), f"{np.median(led):.1f}", *below])
    return table(["", "cases", "with a leader", "its time gap, median [s]", "below 1 s", "below 1.5 s"], lines)


def fullness(task: Task) -> str:
    """The recordings that hold test pairs: their length, cars, cars at a time, and pairs."""
    lines = []
    for name, places in groups(task):
        scenes = list({scene.recording: scene for scene, _ in places}.values())
        at_start = [len(scene.present(pair.start)) for scene, pair in places]
        lengths = np.array([scene.cycles / 10 for scene in scenes])
        cars = np.array([len(scene) for scene in scenes])
        missing = sum(int(scene.length_missing.sum()) for scene in scenes)
        seconds, count = (f"{v.min():.0f}" if len(v) == 1 else f"{v.min():.0f}–{v.max():.0f}" for v in (lengths, cars))
        lines.append([name, str(len(places)), seconds, count, f"{np.mean(at_start):.1f}", f"{missing} of {cars.sum()}"])
    return table(
        ["recording", "test pairs", "length [s]", "cars", "cars at a pair's start, mean", "without a length"], lines
    )


def groups(task: Task) -> Iterator[tuple[str, list]]:
    """The places of each fragment, and of all episodes together."""
    named: dict[str, list] = {}
    assert isinstance(task.cases, LoggedCases)
    for place in task.cases.places:
        name = place[0].recording
        named.setdefault("episodes" if name.startswith("episode") else name, []).append(place)
    yield from sorted(named.items(), key=lambda item: (item[0] == "episodes", item[0]))


def main(argv: Sequence[str] | None = None) -> None:
    """Fill the tables."""
    parser = page_parser(__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with real NGSIM files")
    parser.add_argument("--out", type=Path, required=True, help="folder for the sweeps")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    given = parser.parse_args(argv)
    base = SweepRequest((), METHODS, data=given.data, source="ngsim", jobs=given.jobs)
    if given.short:
        base = replace(base, methods=METHODS[:1], settings=SHORT)
    rows, facts = run_all(base, given.out)
    batch = replay(base)
    tables = {
        "fullness": fullness(batch),
        "starts": starts(batch),
        "failures": by_method(rows, tuple(RUNS.values()), failures),
        "means": by_method(rows, (ALONE, LOG, RELEASED), means),
        "gaps": by_method(rows, (LOG, RELEASED), gaps),
        "through": by_method(facts, (BLIND, LOG, RELEASED), through),
        "released": by_method(facts, (RELEASED,), handed),
    }
    fill_page("scenes.md", given.docs, {"table": lambda name: f"\n{tables[name]}\n"})


if __name__ == "__main__":
    main()
