"""The bench: all figures of one machine in one document, and the page that shows them."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from threading import Event, Thread
from typing import Any

from merge_cosim.bench.loops import ALTERNATIVES, compare
from merge_cosim.bench.peers import CASE, peers
from merge_cosim.bench.regression import against
from merge_cosim.bench.scaling import beside, methods_scaling, scaling
from merge_cosim.bench.scenes import METHOD as SCENE_METHOD
from merge_cosim.bench.scenes import SCENARIO as SCENE_SCENARIO
from merge_cosim.bench.scenes import scene_costs
from merge_cosim.bench.updates import estimator_costs
from merge_cosim.bench.worlds import SCENARIO as WORLD_SCENARIO
from merge_cosim.bench.worlds import world_costs
from merge_cosim.core.errors import UserError
from merge_cosim.sweeps.identity import versions

HEAD = """# Bench

How fast merge-cosim is on one machine. In short:

{conclusion}
Made by

```
{command}
```

on {date}: {machine}.

{load}
Times are wall times, unless processor time (`cpu`) is named; loops, estimators and sweeps take turns, and the
median of {rounds} is shown. Absolute times swing with what else the machine does, wall times most; ratios of processor
times of one run hold best.
"""
LOOPS = """## One process against SUMO's bare steps, and against the obvious alternatives

{cases} cases of `{scenario}` under `{method}` by our loop, {sample} of them by each alternative, scaled by vehicles
times steps. The alternatives are in `tools/bench/`: they make the same decisions in scalar code, and the bench fails
if one of their outcomes differs from ours. `scalar` keeps one libsumo and adds and removes each case's cars, `restart`
starts SUMO for every case, `traci` talks to one sumo over a socket (the wait for the connection is not counted).
"""
WORLDS = """## SUMO and the closed form

Processor time per vehicle and step [us] by method in one process, scoring and result rows included: `{world_scenario}`
in SUMO ({cases} cases), and with `--world closed-form` (all cases). "Of it estimator and controller" is wall time: the
rest is the loop's.
"""
UPDATES = """## One update of each estimator

Processor time per encounter [us], in a full batch and alone.
"""
PEERS = """## Other simulators

Simulated steps of one scene, and vehicles times steps, per second of processor time. Ours is the vector environment
with 4,096 encounters under random actions, observing, rewarding and scoring included. highway-env moves cars by models
of its own in Python. commonroad-sumo replays the two cars of `{commonroad_case}`, exported by `merge-cosim export
--commonroad`, in SUMO and takes the states over; it neither estimates nor scores. Building networks and starting SUMO
are not counted.
"""
METHODS = """## Growth over methods

Processor time of the whole command on {growth_cases} cases of `designed-random` in the closed form, one process, with
more and more methods.
"""
SCENES = """## Living traffic

`{scene_scenario}` on {copies} copies of the ramp in one process, three minutes from empty, hosts driven by
`{scene_method}`. The real-time factor is simulated time over wall time of the whole loop, observing, estimating and
commanding included; cars are the mean over the run.
"""
SCALING = """## Whole sweeps by cases and processes

`designed-random` under `acc`. "Run" is the time with all processes at work, their start included; "in the loops" is
summed over processes; the memory is the peak of the largest process.
"""
OTHER = """## Another version

One sweep in SUMO by this version and by the other one, in turns; a ratio above 1 says that this one is slower.
"""
AGAINST = """## Against the bench of {before_date}

Ratios of processor times within one run, which hold across machines better than times do; larger is better. One that
fell by more than {tolerance} % is marked.
"""
NAMES = {
    "sumo_cpu_us": "in SUMO",
    "closed_form_cpu_us": "in closed form",
    "update_us": "of it estimator and controller",
    "closed_form_is_cheaper_by": "SUMO / closed form",
    "full_batch_us": "in a full batch",
    "alone_us": "alone",
    "steps_per_cpu_s": "steps per s",
    "vehicle_steps_per_cpu_s": "vehicle-steps per s",
    "ours_makes_more_by": "ours makes more by",
    "meetings": "meetings",
    "real_time_factor": "real-time factor",
    "us_per_vehicle_step": "us per vehicle and step",
    "ratio_to_bare_sumo": "time / SUMO's bare steps",
    "wall_s": "wall [s]",
    "plan_s": "plan [s]",
    "run_s": "run [s]",
    "store_s": "store [s]",
    "cpu_s": "cpu [s]",
    "ms_per_case": "run per case [ms]",
    "loop_ms_per_case": "in the loops per case [ms]",
    "peak_mib": "memory [MiB]",
    "other_cpu_s": "other's cpu [s]",
    "cpu_ratio": "ratio of cpu",
    "loop_s": "loop [s]",
    "other_loop_s": "other's loop [s]",
    "loop_ratio": "ratio of loops",
    "change_pct": "change [%]",
}
"""Heads of the page's tables, where they are not the names of the figures."""
MOST = 10_000
"""Cases with which growth over methods is measured and another version compared, at most."""
TOLERANCE = 0.15
"""How much a ratio may fall before it counts as a regression."""
PARTS = ("loops", "worlds", "estimators", "peers", "methods", "scenes", "scaling")
"""The parts of the bench, in the order of the page."""


def bench(
    cases: int = 2_000,
    sample: int = 100,
    rounds: int = 5,
    largest: int = 100_000,
    jobs: int | None = None,
    copies: int = 16,
    only: Sequence[str] = (),
    commonroad_python: Path | None = None,
    other: Path | None = None,
) -> dict[str, Any]:
    """Take the figures.

    Args:
        cases: Cases that our loop runs.
        sample: Of them, how many the alternatives run.
        rounds: How often each is timed.
        largest: Cases of the largest sweep; those of a tenth and a hundredth are run, too.
        jobs: Processes of the sweeps on several; one per core by default.
        copies: Copies of the ramp that living traffic is timed on.
        only: Names of `PARTS` to take; empty for all.
        commonroad_python: Python of an environment with commonroad-sumo, to time it, too.
        other: Checkout of another version, to run one sweep by both in turns.

    Raises:
        UserError: A name in `only` is none of `PARTS`; a path is not what it should be; an alternative decides
            otherwise than our loop.
    """
    if unknown := [name for name in only if name not in PARTS]:
        raise UserError(f"bench: no part {unknown[0]!r}; the parts are {', '.join(PARTS)}")
    if commonroad_python is not None and not commonroad_python.is_file():
        raise UserError(f"{commonroad_python}: no such file; name the Python of an environment with commonroad-sumo")
    if other is not None and not (other / "merge_cosim" / "cli" / "main.py").is_file():
        raise UserError(f"{other}: no checkout of merge-cosim; name the folder that holds merge_cosim/")
    several = jobs or os.cpu_count() or 1
    sizes = sorted({max(1, largest // 100), max(1, largest // 10), largest})
    takes: dict[str, Callable[[], Any]] = {
        "loops": lambda: compare(cases, sample, rounds),
        "worlds": lambda: world_costs(cases, rounds),
        "estimators": lambda: estimator_costs(rounds),
        "peers": lambda: peers(commonroad_python),
        "methods": lambda: methods_scaling(min(largest, MOST), rounds),
        "scenes": lambda: scene_costs(copies),
        "scaling": lambda: scaling(sizes, sorted({1, several}), rounds),
    }
    if other is not None:
        takes["other"] = lambda: beside(other, min(largest, MOST), rounds)
    found: dict[str, Any] = {
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "machine": machine(),
        "versions": versions(),
        "rounds": rounds,
        "copies": copies,
        "cases": cases,
        "growth_cases": min(largest, MOST),
        "load": {},
    }
    for part in takes if not only else [*only, *(("other",) if other is not None else ())]:
        with _LoadWatch() as watch:
            figures = takes[part]()
        found["load"][part] = watch.highest
        found |= figures if part == "loops" else {part: figures}
    return found


class _LoadWatch:
    """The highest load of the machine from entering to leaving, looked up every few seconds."""

    def __enter__(self) -> _LoadWatch:
        self.highest = load()
        self._over = Event()
        self._thread = Thread(target=self._watch, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._look()

    def _watch(self) -> None:
        while not self._over.wait(5.0):
            self._look()

    def _look(self) -> None:
        self.highest = max((one for one in (self.highest, load()) if one is not None), default=None)


def load() -> float | None:
    """The machine's load of the last minute; None where the system does not say."""
    return round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None


def crowded(found: Mapping[str, Any], part: str) -> str:
    """A mark for a part of the figures during which the load exceeded the cores; empty if it did not.

    Our own processes count, so a part that keeps every core busy is allowed half a process more.
    """
    seen, cores = found["load"][part], found["machine"]["cores"]
    if seen is None or seen <= cores + 0.5:
        return ""
    return f"**The load rose to {seen} on {cores} cores: wall times of this part are too long.**\n"


def machine() -> dict[str, Any]:
    """What the figures were taken on."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gib": _memory_gib(),
        "system": f"{platform.system()} {platform.machine()}",
        "load_before": load(),
    }


def page(found: Mapping[str, Any], command: str, before: Mapping[str, Any] | None = None) -> str:
    """The figures as a page in Markdown, and beside those of an earlier bench where there is one."""
    where = found["machine"]
    described = f"{where['processor']}, {where['cores']} cores, {where['memory_gib']} GiB, {where['system']}"
    versions_used = ", ".join(f"{name} {number}" for name, number in found["versions"].items())
    load_before = where["load_before"]
    parts = [
        HEAD.format(
            command=command,
            conclusion="".join(f"- {one}\n" for one in conclusion(found)),
            machine=f"{described}; {versions_used}",
            load=""
            if load_before is None
            else f"Load of the machine before the start: {load_before} (0: nothing ran).",
            **_only(found, "date", "rounds"),
        )
    ]
    heads = {"worlds": WORLDS, "peers": PEERS, "estimators": UPDATES, "methods": METHODS, "scenes": SCENES}
    values = {
        **_only(found, "cases", "copies", "growth_cases"),
        "world_scenario": WORLD_SCENARIO,
        "commonroad_case": " ".join(CASE),
    }
    values |= {"scene_scenario": SCENE_SCENARIO, "scene_method": SCENE_METHOD}
    for part in found["load"]:
        mark = crowded(found, part)
        if part == "loops":
            parts += [LOOPS.format(**_only(found, "cases", "scenario", "method", "sample")), mark, _loops(found)]
        elif part == "scaling":
            parts += [SCALING, mark, _table(found["scaling"]), *_gains(found["scaling"])]
        elif part == "other":
            parts += [OTHER, mark, _table([found["other"]])]
        elif found[part]:
            parts += [heads[part].format(**values), mark, _table(found[part])]
    if before is not None:
        rows = against(found, before, TOLERANCE)
        parts += [AGAINST.format(tolerance=round(100 * TOLERANCE), before_date=before["date"])]
        parts += [_table(rows) if rows else "The two have no ratio in common.\n"]
    return "\n".join(filter(None, parts))


def conclusion(found: Mapping[str, Any]) -> Iterator[str]:
    """What each part that was taken says, a sentence or two each."""
    taken = [part for part in PARTS if found.get(part) or part in found["load"]]
    if "loops" in taken:
        speedups = [f"{found[f'cpu_speedup_vs_{name}']:.3g} times as fast as `{name}`" for name in ALTERNATIVES]
        yield (
            f"In SUMO one process moves {found['vehicle_steps_per_s']:,} vehicles by a step per second; its wall time "
            f"is {found['ratio_to_bare_sumo']:.2f} times that of SUMO's own steps. By processor time it is "
            f"{', '.join(speedups)}, the obvious ways to write the loop (below)."
        )
    if "worlds" in taken:
        rows = sorted(found["worlds"], key=lambda row: row["closed_form_is_cheaper_by"])
        low, high = (f"{row['closed_form_is_cheaper_by']} ({row['method']})" for row in (rows[0], rows[-1]))
        yield f"In closed form an encounter takes from {low} to {high} times less processor time than in SUMO."
    if "scaling" in taken:
        largest = found["scaling"][-1]
        took = f"{largest['wall_s']:.0f} s on {largest['processes']} processes"
        yield f"{largest['cases']:,} encounters in SUMO under `acc` take {took}."
    if "scenes" in taken:
        factors = [row["real_time_factor"] for row in found["scenes"]]
        cars = max(row["cars"] for row in found["scenes"])
        yield f"Living traffic with {cars:,} cars runs {min(factors)} to {max(factors)} times as fast as real time."
    if "peers" in taken:
        more = [
            f"{row['ours_makes_more_by']:,.0f} times as many as {row['simulator']}"
            for row in found["peers"][1:]
            if row["ours_makes_more_by"] is not None
        ]
        if more:
            yield f"Steps of a scene per second of processor time, by the vector environment: {', '.join(more)}."


def _loops(found: Mapping[str, Any]) -> str:
    rows = [
        {
            "loop": name or "ours",
            "us per vehicle and step": found["_".join(filter(None, (name, "us_per_vehicle_step")))],
            "cpu us": found["_".join(filter(None, (name, "cpu_us_per_vehicle_step")))],
            "ours is faster by": found.get(f"speedup_vs_{name}", ""),
            "by cpu": found.get(f"cpu_speedup_vs_{name}", ""),
        }
        for name in ("", *ALTERNATIVES)
    ]
    return _table(rows) + (
        f"\nOurs: {found['vehicle_steps_per_s']:,} vehicle-steps per second; wall time over the time inside "
        f"`simulationStep` of the same run: **{found['ratio_to_bare_sumo']}**.\nBare step and calls alone: "
        f"**{found['steps_and_calls_to_bare_sumo']}**, with the calls that place, command and read each car, the "
        f"least\nthat a loop by these calls can take. The rest is estimating, deciding, recording and scoring.\n"
    )


def _gains(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    largest = rows[-1]
    return [
        f"Over {largest['cases']:,} cases {largest['processes']} processes are "
        f"{alone['run_s'] / largest['run_s']:.2f} times as fast as {alone['processes']} by the time of the run, and "
        f"{alone['wall_s'] / largest['wall_s']:.2f} times with planning and summing up, done by one.\n"
        for alone in rows
        if alone["cases"] == largest["cases"] and alone is not largest
    ]


def write_page(file: Path, found: Mapping[str, Any], command: str, before: Mapping[str, Any] | None = None) -> None:
    """Write the page, and the figures beside it as JSON, for `merge-cosim bench --against`."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(page(found, command, before), encoding="utf-8")
    file.with_suffix(".json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def _only(found: Mapping[str, Any], *names: str) -> dict[str, Any]:
    return {name: found[name] for name in names}


def _table(rows: Sequence[Mapping[str, Any]]) -> str:
    names = list(rows[0])
    heads = [NAMES.get(name, name) for name in names]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(names)]
    lines += ["| " + " | ".join(str(row[name]) for name in names) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _memory_gib() -> float | None:
    try:
        return round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1)
    except (ValueError, OSError, AttributeError):
        return None
