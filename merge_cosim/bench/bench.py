"""The bench: all figures of one machine in one document, and the page that shows them."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

from merge_cosim.bench.loops import compare, highway
from merge_cosim.bench.scaling import scaling
from merge_cosim.bench.scenes import METHOD as SCENE_METHOD
from merge_cosim.bench.scenes import SCENARIO as SCENE_SCENARIO
from merge_cosim.bench.scenes import scene_costs
from merge_cosim.bench.updates import estimator_costs
from merge_cosim.bench.worlds import SCENARIO as WORLD_SCENARIO
from merge_cosim.bench.worlds import world_costs
from merge_cosim.sweeps.identity import versions

T = TypeVar("T")

HEAD = """# Bench

How fast merge-cosim is on one machine, made by

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

Processor time per vehicle and step [us] by method in one process, scoring and result rows included: `{scenario}` in
SUMO ({cases} cases), and with `--world closed-form` (all cases).
"""
UPDATES = """## One update of each estimator

Processor time per encounter [us], in a full batch and alone.
"""
SCENES = """## Living traffic

`{scenario}` on {copies} copies of the ramp in one process, three minutes from empty, hosts driven by `{method}`. The
real-time factor is simulated time over wall time of the whole loop, observing, estimating and commanding included;
`cars` is the mean over the run.
"""
SCALING = """## Whole sweeps by cases and processes

`designed-random` under `acc`. `run_s` is the time with all processes at work, their start included; `loop_ms_per_case`
is the time in the loops, summed over processes; `peak_mib` is the largest process.
"""


def bench(
    cases: int = 2_000,
    sample: int = 100,
    rounds: int = 5,
    largest: int = 100_000,
    jobs: int | None = None,
    copies: int = 16,
) -> dict[str, Any]:
    """Take all figures.

    Args:
        cases: Cases that our loop runs.
        sample: Of them, how many the alternatives run.
        rounds: How often each is timed.
        largest: Cases of the largest sweep; those of a tenth and a hundredth are run, too.
        jobs: Processes of the sweeps on several; one per core by default.
        copies: Copies of the ramp that living traffic is timed on.
    """
    several = jobs or os.cpu_count() or 1
    sizes = sorted({max(1, largest // 100), max(1, largest // 10), largest})
    loads: dict[str, float | None] = {}

    def watched(part: str, take: Callable[[], T]) -> T:
        before, taken = load(), take()
        loads[part] = max((one for one in (before, load()) if one is not None), default=None)
        return taken

    return {
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "machine": machine(),
        "versions": versions(),
        "rounds": rounds,
        **watched("loops", lambda: compare(cases, sample, rounds)),
        "highway_env": watched("highway_env", highway),
        "worlds": watched("worlds", lambda: world_costs(cases, rounds)),
        "estimators": watched("estimators", lambda: estimator_costs(rounds)),
        "copies": copies,
        "scenes": watched("scenes", lambda: scene_costs(copies)),
        "scaling": watched("scaling", lambda: scaling(sizes, sorted({1, several}), rounds)),
        "load": loads,
    }


def load() -> float | None:
    """The machine's load of the last minute; None where the system does not say."""
    return round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None


def crowded(found: Mapping[str, Any], part: str) -> str:
    """A mark for a part of the figures during which the load exceeded the cores; empty if it did not."""
    seen, cores = found["load"][part], found["machine"]["cores"]
    if seen is None or seen <= cores:
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


def page(found: Mapping[str, Any], command: str) -> str:
    """The figures as a page in Markdown."""
    where = found["machine"]
    described = f"{where['processor']}, {where['cores']} cores, {where['memory_gib']} GiB, {where['system']}"
    versions_used = ", ".join(f"{name} {number}" for name, number in found["versions"].items())
    loops = [
        {
            "loop": name or "ours",
            "us per vehicle and step": found["_".join(filter(None, (name, "us_per_vehicle_step")))],
            "cpu us": found["_".join(filter(None, (name, "cpu_us_per_vehicle_step")))],
            "ours is faster by": found.get(f"speedup_vs_{name}", ""),
            "by cpu": found.get(f"cpu_speedup_vs_{name}", ""),
        }
        for name in ("", "scalar", "restart", "traci")
    ]
    before = where["load_before"]
    parts = [
        HEAD.format(
            command=command,
            machine=f"{described}; {versions_used}",
            load="" if before is None else f"Load of the machine before the start: {before} (0: nothing else ran).",
            **_only(found, "date", "rounds"),
        ),
        LOOPS.format(**_only(found, "cases", "scenario", "method", "sample")),
        crowded(found, "loops"),
        _table(loops),
        f"Ours: {found['vehicle_steps_per_s']:,} vehicle-steps per second; wall time over the time inside "
        f"`simulationStep` of the same run: **{found['ratio_to_bare_sumo']}**.\n",
    ]
    if found["highway_env"]:
        theirs = found["highway_env"]
        parts.append(
            f"For scale, another simulator with other models: `merge-v0` of highway-env {theirs['version']} makes "
            f"{theirs['steps_per_s']:,} simulated steps, {theirs['vehicle_steps_per_s']:,} vehicle-steps, per second "
            f"({theirs['vehicle_steps_per_cpu_s']:,} vehicle-steps per second of processor time).\n"
        )
    parts += [WORLDS.format(scenario=WORLD_SCENARIO, cases=found["cases"]), crowded(found, "worlds")]
    parts += [_table(found["worlds"]), UPDATES, crowded(found, "estimators"), _table(found["estimators"])]
    parts += [
        SCENES.format(scenario=SCENE_SCENARIO, method=SCENE_METHOD, copies=found["copies"]),
        crowded(found, "scenes"),
        _table(found["scenes"]),
    ]
    parts += [SCALING, crowded(found, "scaling"), _table(found["scaling"])]
    largest = found["scaling"][-1]
    for alone in found["scaling"]:
        if alone["cases"] == largest["cases"] and alone is not largest:
            parts.append(
                f"Over {largest['cases']:,} cases {largest['processes']} processes are "
                f"{alone['run_s'] / largest['run_s']:.2f} times as fast as {alone['processes']} by `run_s`, and "
                f"{alone['wall_s'] / largest['wall_s']:.2f} times with planning and summing up, done by one.\n"
            )
    return "\n".join(filter(None, parts))


def write_page(file: Path, found: Mapping[str, Any], command: str) -> None:
    """Write the page."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(page(found, command), encoding="utf-8")


def _only(found: Mapping[str, Any], *names: str) -> dict[str, Any]:
    return {name: found[name] for name in names}


def _table(rows: Sequence[Mapping[str, Any]]) -> str:
    names = list(rows[0])
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
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
