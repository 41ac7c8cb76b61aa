"""What happened in one case, in five lines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

FAILURES = {
    "side": "the cars already overlap in the first scored cycle",
    "host_into_merging": "the host runs into the merging car",
    "merging_into_host": "the merging car runs into the host",
    "host_into_leader": "the host runs into the car ahead of it",
}


def story(row: Mapping[str, Any]) -> list[str]:
    """Describe a result row, or the facts of a whole scene, in five lines, and one for each broken invariant."""
    known = {name: value for name, value in row.items() if value is not None and value == value}
    return _of_pair(known) if "failed" in known else _of_scene(known)


def _of_pair(row: Mapping[str, Any]) -> list[str]:
    model = f" (model {row['model']})" if row["model"] else ""
    cars = (("host", "host"), ("merging car", "merging"))
    start = (f"{name} {row[f'{car}_station_0_m']:.1f} m, {row[f'{car}_speed_0']:.1f} m/s" for name, car in cars)
    return [
        f"{row['scenario']} {row['case']}, {row['source']}: {row['method']}{model} in {row['world']}",
        f"start   {'; '.join(start)} (0 m: merge)",
        f"merge   {_order(row)}",
        f"result  {_outcome(row)}",
        f"cost    {_cost(row)}",
        *row.get("broken", []),
    ]


def _order(row: Mapping[str, Any]) -> str:
    times = {"host": row.get("host_reached_s"), "merging car": row.get("merging_reached_s")}
    arrived = sorted((time, name) for name, time in times.items() if time is not None)
    text = ", ".join(f"{name} after {time:.1f} s" for time, name in arrived) or "no car arrives"
    return f"{text}; D {row['distance_m']:.1f} m as the host arrives" if "distance_m" in row else text


def _outcome(row: Mapping[str, Any]) -> str:
    text = outcome(row)
    if "min_gap_m" in row:
        text += f"; smallest gap {row['min_gap_m']:.1f} m"
    return f"{text}; ended after {row['end_s']:.1f} s"


def outcome(row: Mapping[str, Any]) -> str:
    """How a case ended, in one phrase."""
    if row["failed"]:
        return f"FAILED: {FAILURES[row['failure_kind']]}"
    if row["stuck"]:
        return "STUCK: time ran out before the host was at the merging point"
    return "censored: it could not be scored to its end" if row["censored"] else "no failure"


def _cost(row: Mapping[str, Any]) -> str:
    found = [f"delay {round(row['delay_s'], 2) + 0.0:.2f} s, hardest braking {row['hardest_braking']:.1f} m/s²"]
    if "decision_flips" in row:
        found.append(f"decision changes {row['decision_flips']}")
    if "correct_at_merge" in row:
        found.append(f"{'right' if row['correct_at_merge'] else 'wrong'} at the merge ({row['label']})")
    return "; ".join(found)


def _of_scene(facts: Mapping[str, Any]) -> list[str]:
    def listed(**names: str) -> str:
        return ", ".join(form.format(facts[name]) for name, form in names.items() if name in facts)

    model = f" (model {facts['model']})" if facts["model"] else ""
    notes = [what for _, what in facts["notes"]]
    return [
        f"{facts['scenario']}, scene {facts['scene']}: {facts['method']}{model}",
        "traffic "
        + listed(simulated_s="{:,.0f} s", throughput_veh_h="{:,.0f} cars out per hour", mean_speed="{:.1f} m/s")
        + listed(time_loss_s=", {:.1f} s lost per car", cars="{:.1f} logged cars at the start"),
        "hosts   " + listed(hosts="hosts {}", meetings="meetings {}", meetings_scored="scored {}"),
        "safety  "
        + listed(host_contacts="contacts of hosts {}", other_contacts="of others {}")
        + listed(emergency_brakings=", emergency brakings {:.0f}", driven_through=", cars that drove into a host {}"),
        f"notes   {notes[0] if notes else 'none'}" + f"; {len(notes) - 1} more, see --json" * (len(notes) > 1),
    ]
