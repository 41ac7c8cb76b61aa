"""Order, headings and numbers of the tables."""

import numpy as np
import pandas as pd
import pytest

from merge_cosim.core.colors import rgba
from merge_cosim.report.columns import Column, Table
from merge_cosim.report.latex import latex
from merge_cosim.report.methods import FAMILY_COLORS, KNOWN, in_order, looks
from merge_cosim.report.published import published
from merge_cosim.report.tables import Section, main_table, sections, strata_table, summary_frame, variation_table
from merge_cosim.results.store import SUMMARY_JSON, ResultFolder
from merge_cosim.scenarios.methods import REFERENCES, is_reference

GRID = Section("designed-2", "designed", "designed")


@pytest.fixture(scope="module")
def summary(swept):
    labels = ["merging.ahead=clear", "merging.ahead=any", "test.horizon=1", "test.horizon=3"]
    return summary_frame(ResultFolder(swept).read_json(SUMMARY_JSON), labels)


def test_methods_come_first_and_references_last():
    mixed = ["oracle-best", "zeta", "pgm-time", "always-go", "fg-gmm", "pgm-g", "acc", "pgm", "slot+lqr"]
    assert in_order(mixed) == [
        "acc",
        "slot+lqr",
        "pgm-g",
        "pgm",
        "pgm-time",
        "fg-gmm",
        "zeta",
        "always-go",
        "oracle-best",
    ]
    assert is_reference("always-yield+acc")
    assert not is_reference("alwaysgo")


def test_a_method_keeps_its_colour():
    assert looks(["pgm", "mine"])["pgm"] == looks(["acc", "pgm", "always-go"])["pgm"]


def test_no_two_methods_look_alike():
    methods = [
        *KNOWN,
        *(f"{name}+{law}" for name in ("pgm", "acc") for law in ("lqr", "pcb")),
        *"abcdefgh",
        *REFERENCES,
    ]
    found = looks(methods)
    assert len({(look.color, look.mark) for look in found.values()}) == len(set(methods))
    assert found["pgm+lqr"].color == found["pgm"].color


DEFICIENCIES = {
    "normal": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
}
"""Linear RGB as it is seen (Machado, Oliveira, Fernandes 2009, severity 1)."""


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
def test_families_are_distinguished_by_the_colour_blind(deficiency):
    """Their colours differ by at least 15 in CIELAB; just noticeable is 2.3."""
    encoded = np.array([rgba(color)[:3] for color in FAMILY_COLORS.values()]) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ np.transpose(DEFICIENCIES[deficiency]), 0, 1)
    xyz = seen @ np.transpose([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    share = xyz / [0.9505, 1, 1.089]
    f = np.where(share > 0.008856, np.cbrt(share), 7.787 * share + 16 / 116)
    lab = np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)
    apart = np.linalg.norm(lab[:, None] - lab[None], axis=2)
    assert apart[~np.eye(len(lab), dtype=bool)].min() > 15


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [(1234.567, 1, "1,234.6"), (-0.5, 2, "−0.50"), (0, 2, "0.00"), (-0.001, 2, "0.00"), (None, 1, "–"), (7, 0, "7")],
)
def test_numbers_as_text(value, decimals, text):
    assert Column("x", "x", decimals).text(value) == text


def test_a_column_without_values_is_left_out():
    table = Table.of(pd.DataFrame({"a": [1.0], "b": [None]}), [Column("a", "a", 0), Column("b", "b", 0)], "T_1")
    assert [column.name for column in table.columns] == ["a"]
    assert r"\caption{T\_1}" in latex(table)


def test_published_figures():
    assert published("us101-replay", "pgm").failure_pct == 8.7
    assert published("i80-replay", "acc").distance_m == 7.0
    assert published("designed-1", "pgm-g").failure_pct == 0.9
    assert published("designed-2", "always-go") is None


def test_main_table(summary):
    assert sections(summary) == [GRID]
    table = main_table(summary, GRID)
    assert table.apart == (False, False, False, True)
    assert dict(table.groups)["published"] == 1  # Table II gives no D for the designed tests


def test_strata_add_up(swept):
    results = ResultFolder(swept).results().to_pandas()
    data = strata_table(results, GRID).data
    counts = data[["n_0_1s", "n_1_3s", "n_3_infs"]]
    assert (counts.sum(axis=1) == 27).all()
    plain = results[(results["method"] == "always-go") & (results["variation"] == "")]
    sure = plain[plain["ambiguity_s"] < 1]
    shown = data.set_index("method").loc["always-go", "failure_pct_0_1s"]
    assert shown == pytest.approx(100 * sure["failed"].mean())


def test_varied_values_keep_the_users_order(summary):
    table = variation_table(summary, "designed-2", "merging.ahead").data
    assert table["value"].tolist()[:3] == ["as it stands", "clear", "any"]
    unvaried, clear = table[table["method"] == "always-go"]["failures"].tolist()[:2]
    assert unvaried == clear
