"""Cells and columns of NGSIM files, one by one; tests/ngsim/test_read.py reads whole files."""

import re
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
from ngsim_files import car, write_csv

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import FOOT
from merge_cosim.ngsim.clean import Place, checked, numbers
from merge_cosim.ngsim.formats import LIMITS, WIDE, sources
from merge_cosim.ngsim.rows import needed_columns
from merge_cosim.ngsim.sites import site


@pytest.fixture
def place(tmp_path):
    """The lines 2 to 4 of a file in feet."""
    (source,) = sources(write_csv(tmp_path / "a.csv", car(1, range(3))))
    return Place(source, np.arange(2, 5))


def column(*cells):
    return pa.chunked_array([pa.array(cells)])


def test_numbers_may_have_commas_between_thousands(place):
    assert numbers(column("1,234.5", "-2", "3e1"), "Local_Y", place).tolist() == [1234.5, -2.0, 30.0]


def test_a_cell_that_is_no_number_is_named_with_its_line(place):
    with pytest.raises(UserError, match=r"a\.csv, line 3: Local_Y is '1,23', not a number"):
        numbers(column("1", "1,23", "3"), "Local_Y", place)
    with pytest.raises(UserError, match=r"line 4: Lane_ID is .*, not a whole number"):
        checked(column(1.0, 2.0, 2.5), "Lane_ID", "lane", place)
    with pytest.raises(UserError, match=r"line 2: v_Vel is .*, impossible: outside"):
        checked(column(-1e6, 0.0, 0.0), "v_Vel", "speed", place)


@pytest.mark.parametrize(
    ("limits", "name", "low", "high"),
    [
        (LIMITS, "vehicle_id", -100_000_000, 100_000_000),
        (LIMITS, "part", 0, 10_000),
        (LIMITS, "frame", 0, 100_000_000),
        (LIMITS, "time", 0, 100_000_000),
        (LIMITS, "x", -50, 100),
        (LIMITS, "y", -100, 1000),
        (LIMITS, "speed", -1, 100),
        (LIMITS, "length", 0, 50),
        (LIMITS, "width", 0, 10),
        (LIMITS, "lane", 0, 20),
        (WIDE, "x", -1_000_000, 1_000_000),
        (WIDE, "y", -1_000_000, 1_000_000),
        (WIDE, "lane", -32_768, 32_767),
        (WIDE, "speed", -1, 100),
    ],
)
def test_the_least_and_the_largest_value_are_possible_and_no_more(place, limits, name, low, high):
    layout = replace(place.source.layout, unit=1.0, limits=limits)
    here = Place(replace(place.source, layout=layout), place.rows)
    least = np.nan if name in ("length", "width") else low  # not logged
    np.testing.assert_array_equal(checked(column(low, high), "c", name, here), [least, high])
    for wrong in (low - 1, high + 1):
        with pytest.raises(
            UserError, match=re.escape(f"line 3: c is {wrong}, impossible: outside {low:g} to {high:g}")
        ):
            checked(column(low, wrong), "c", name, here)


def test_values_are_in_si_units_and_missing_lengths_are_nan(place):
    assert checked(column(0.0, 10.0, 20.0), "v_Vel", "speed", place) == pytest.approx([0.0, 10 * FOOT, 20 * FOOT])
    found = checked(column("15", "0", "nan"), "v_Length", "length", place)
    assert found == pytest.approx([15 * FOOT, np.nan, np.nan], nan_ok=True)


def test_only_needed_columns_are_read(place):
    columns = needed_columns(place.source, site("us101"))
    assert {"Vehicle_ID", "Frame_ID", "Local_X", "Local_Y", "v_Vel", "Lane_ID"} <= set(columns)
    assert set(columns) < set(place.source.columns)
