"""The columns of `results.parquet`: names, types, units and definitions. The page of measures is made from them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import pyarrow as pa

from merge_cosim.scoring.decisions import GATES

SCHEMA_VERSION = "4"
"""Raised whenever a column is added, removed, or changes its meaning. Folders of other versions are refused."""
VERSION_KEY = b"merge_cosim_schema"
KEY = [(name, "ascending") for name in ("scenario", "variation", "case", "method", "model")]
"""The columns that name a row, in the order in which rows are sorted."""

TEXT, FLAG, NUMBER, COUNT = pa.string(), pa.bool_(), pa.float64(), pa.int32()


@dataclass(frozen=True)
class Column:
    """One column, or one for each gate where the name ends in `_G`.

    Attributes:
        name: Its name.
        type: Its Arrow type.
        unit: Its unit; empty where it has none.
        meaning: Its definition, in Markdown.
        missing: Where it is undefined, and so missing; empty where it always has a value.
    """

    name: str
    type: pa.DataType
    unit: str
    meaning: str
    missing: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of its columns in the file."""
        stem, per_gate, _ = self.name.partition("_G")
        return tuple(f"{stem}_{gate}" for gate in GATES) if per_gate else (self.name,)


NEITHER_ARRIVES, NO_LABEL, NEVER_CROSSES, NO_SCENE = (
    "neither car arrives",
    "no label",
    "never crosses",
    "not a scene",
)

COLUMNS = (
    Column("scenario", TEXT, "", "name of the scenario"),
    Column("variation", TEXT, "", "what was varied in it, such as `acc.headway=1.0`; empty: nothing"),
    Column(
        "site",
        TEXT,
        "",
        "where the data are from; for route files and traffic the ramp, for other made-up states `designed`",
    ),
    Column(
        "source",
        TEXT,
        "",
        "`ngsim`, `recorded` (another recording), `surrogate`, `designed` (a grid, or cars of route files), "
        "`random` or `traffic`",
    ),
    Column("case", TEXT, "", "name of the case; its initial state is in columns of its own"),
    Column("car", TEXT, "", "the logged merging car (`site/recording/vehicle/part`); empty: not from a log"),
    Column("method", TEXT, "", "the method, such as `pgm` or `pgm+lqr`"),
    Column("model", TEXT, "", "the model that the method learned from data; empty: none"),
    Column(
        "world",
        TEXT,
        "",
        "what moved the cars: `sumo`, or `closed-form` (stations are sums of the speeds; the row `human`)",
    ),
    Column("host_station_0_m", NUMBER, "m", "the host's station at the start"),
    Column("host_speed_0", NUMBER, "m/s", "its speed at the start"),
    Column("merging_station_0_m", NUMBER, "m", "the merging car's station at the start"),
    Column("merging_speed_0", NUMBER, "m/s", "its speed at the start"),
    Column(
        "failed",
        FLAG,
        "",
        "bodies overlap while scored: from the first cycle with both fronts past the merging point, for "
        "`test.horizon` (3 s)",
    ),
    Column(
        "failure_kind",
        TEXT,
        "",
        "`side`: in the first scored cycle; `host_into_merging`, `merging_into_host`: later, by which car is behind "
        "(Dong, Dolan, Litkouhi 2017, Sec. V; the kinds are ours). In scenes also `host_into_leader`: the host "
        "overlaps the car ahead in its lane. Empty: no failure",
    ),
    Column(
        "stuck",
        FLAG,
        "",
        "time ran out and the host had not reached the merging point; neither failed nor censored. The delay of such "
        "a case is a lower bound",
    ),
    Column(
        "deadlock",
        FLAG,
        "",
        "stuck because the two cars wait for each other: neither has reached the merging point when the run timed out, "
        "and both are slower than 0.5 m/s",
    ),
    Column(
        "in_support",
        FLAG,
        "",
        "the case begins at times to arrival that the model's training pairs had (or at most two bins of 0.5 s from "
        "them); missing without a model",
    ),
    Column(
        "censored",
        FLAG,
        "",
        "could not be scored to the end and had not failed: the log's scoring ended, or time ran out within the "
        "horizon",
    ),
    Column("extended", FLAG, "", "the run outlasts the merging car's log, which goes on at its last speed"),
    Column("smoothed_source", FLAG, "", "the log's positions were smoothed before they were published"),
    Column("host_reached", FLAG, "", "the host's front reached the merging point"),
    Column("host_first", FLAG, "", "it did so before the merging car's", NEITHER_ARRIVES),
    Column("order_swapped", FLAG, "", "the order is not the label's", f"{NEITHER_ARRIVES}; {NO_LABEL}"),
    Column(
        "label",
        TEXT,
        "",
        "`YIELD` or `NOT_YIELD`: the order in the log, or the scripted intention; empty: there is neither",
    ),
    Column(
        "correct_at_merge",
        FLAG,
        "",
        "the last decision before a car is at the merging point equals the label",
        f"{NO_LABEL}; nothing was decided (`human`)",
    ),
    Column(
        "decision_flips",
        COUNT,
        "",
        "changes of the decision before either car is at the merging point",
        "nothing was decided (`human`)",
    ),
    Column(
        "distance_m",
        NUMBER,
        "m",
        "D: front to front when the host's front crosses the merging point, interpolated within the cycle",
        "the host never crosses",
    ),
    Column("gap_m", NUMBER, "m", "bumper to bumper at the same time", "the host never crosses"),
    Column("min_gap_m", NUMBER, "m", "smallest bumper gap in the scored cycles; negative: overlap", "never scored"),
    Column(
        "min_ttc_s",
        NUMBER,
        "s",
        "smallest time to collision in the scored cycles: gap over closing speed",
        "never scored; never closing",
    ),
    Column(
        "max_drac",
        NUMBER,
        "m/s²",
        "largest deceleration to avoid a crash, closing speed² / (2 gap), in the scored cycles with a gap; it has no "
        "bound as bodies come to touch (Almqvist, Hydén, Risser 1991)",
        "never scored; never closing",
    ),
    Column(
        "pet_s",
        NUMBER,
        "s",
        "post-encroachment time at the merging point: from the first car's rear bumper clearing it to the second "
        "car's front reaching it, both interpolated (Allen, Shin, Cooper 1978). Negative: the second front is there "
        "first; the rear then goes on at its last speed",
        "a car never arrives, or was through at the start, or stands on the point",
    ),
    Column(
        "min_leader_gap_m",
        NUMBER,
        "m",
        "in scenes: smallest bumper gap to the car ahead in the host's lane, whichever it is, from the "
        "beginning of the meeting to its end ([traffic](traffic.md))",
        f"{NO_SCENE}; no such car within 150 m",
    ),
    Column(
        "min_leader_ttc_s",
        NUMBER,
        "s",
        "in scenes: smallest gap over closing speed to the car ahead",
        f"{NO_SCENE}; no such car within 150 m; never closing",
    ),
    Column(
        "min_follower_gap_m",
        NUMBER,
        "m",
        "in scenes: the same gap to the car behind",
        f"{NO_SCENE}; no such car within 150 m",
    ),
    Column("merging_stopped", FLAG, "", "in scenes: the merging car stood before it merged", NO_SCENE),
    Column(
        "delay_s",
        NUMBER,
        "s",
        "time to +50 m less what free driving would have taken; from the run's end on the host drives freely. Free "
        "driving is `k_free (v_limit - v)` within bounds, the same for all methods: the scenario's `test.free`",
    ),
    Column("hardest_braking", NUMBER, "m/s²", "the host's largest deceleration"),
    Column("mean_jerk", NUMBER, "m/s³", "mean of its absolute jerk from the second cycle on", "one cycle only"),
    Column(
        "first_stable_s",
        NUMBER,
        "s",
        "time since when the decision has been right, up to the last one that counts",
        f"{NO_LABEL}, or the last decision is wrong",
    ),
    Column(
        "log_odds_G",
        NUMBER,
        "",
        "log P(NOT_YIELD) - log P(YIELD) in the first cycle in which the merging car is G = "
        f"{', '.join(map(str, GATES))} m away or nearer; a rule without doubt has +-inf",
        "the merging car starts nearer than G, or a car is already through",
    ),
    Column("arrival_lead_G", NUMBER, "s", "T_h - T_m in the same cycle", "as `log_odds_G`"),
    Column(
        "human_station_rms_m",
        NUMBER,
        "m",
        "root mean square difference of station to the logged host over the cycles that both drive",
        "nothing is logged",
    ),
    Column("human_speed_rms", NUMBER, "m/s", "the same of speed", "nothing is logged"),
    Column("host_reached_s", NUMBER, "s", "time at which the host's front crosses the merging point", NEVER_CROSSES),
    Column("merging_reached_s", NUMBER, "s", "time at which the merging car's does", NEVER_CROSSES),
    Column("end_s", NUMBER, "s", "time at which the run ends"),
    Column("ambiguity_s", NUMBER, "s", "\\|T_m - T_h\\| at the start"),
    Column("sumo_collision", FLAG, "", "SUMO's own report of a collision ([collisions](collisions.md))"),
)


def _fields() -> Iterator[tuple[str, pa.DataType]]:
    for column in COLUMNS:
        for name in column.names:
            yield name, column.type


SCHEMA = pa.schema(list(_fields()), metadata={VERSION_KEY: SCHEMA_VERSION})
