import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from merge_cosim.ngsim.table import SCHEMA, ClockError, Repeats, canonical, name_recordings


def rows(*cars):
    """A table of (recording, vehicle, part, frame, y) rows."""
    recording, vehicle, part, frame, y = zip(*cars, strict=True) if cars else ((),) * 5
    n = len(vehicle)
    columns = {"site": ["us101"] * n, "recording": recording, "vehicle_id": vehicle, "part": part, "frame": frame}
    columns |= {name: np.zeros(n) for name in ("x", "speed", "length", "width", "lane")} | {"y": y}
    columns["smoothed"] = [False] * n
    return pa.table({f.name: pa.array(columns[f.name]).cast(f.type) for f in SCHEMA})


def keys(table):
    return list(zip(*(table[name].to_pylist() for name in ("recording", "vehicle_id", "part", "frame")), strict=True))


def test_sorted_without_repeats_and_cut_at_gaps():
    given_rows = rows(
        ("b", 1, 1, 7, 7.0), ("a", 2, 1, 5, 5.0), ("a", 2, 1, 4, 4.0), ("a", 2, 1, 8, 8.0), ("a", 2, 1, 5, 5.0)
    )
    table, repeats = canonical(given_rows)
    assert keys(table) == [("a", 2, 1, 4), ("a", 2, 1, 5), ("a", 2, 2, 8), ("b", 1, 1, 7)]
    assert table["y"].to_pylist() == [4.0, 5.0, 8.0, 7.0]
    assert repeats == Repeats(dropped=1, conflicting=0)
    assert table.schema.equals(SCHEMA)


def test_of_contradicting_rows_the_first_is_kept():
    table, repeats = canonical(rows(("a", 1, 1, 1, 10.0), ("a", 1, 1, 1, 12.0), ("a", 1, 1, 1, 10.0)))
    assert table["y"].to_pylist() == [10.0]
    assert repeats == Repeats(dropped=2, conflicting=1)


def test_a_given_part_is_kept_even_without_a_gap():
    table, _ = canonical(rows(("a", 1, 1, 1, 0.0), ("a", 1, 2, 2, 1.0), ("a", 1, 2, 4, 2.0), ("a", 3, 1, 5, 2.0)))
    assert table["part"].to_pylist() == [1, 2, 3, 1]


def test_an_empty_table_stays_empty():
    assert canonical(rows())[0].num_rows == 0


@given(
    st.lists(
        st.tuples(st.sampled_from("ab"), st.integers(-3, 3), st.integers(1, 2), st.integers(0, 8), st.floats(0.0, 9.0)),
        max_size=40,
    )
)
def test_canonical_is_idempotent_and_gap_free(cars):
    table, repeats = canonical(rows(*cars))
    again, none = canonical(table)
    assert again.equals(table)
    assert none == Repeats()
    assert table.num_rows + repeats.dropped == len(cars)
    assert table.num_rows == len({car[:4] for car in cars})
    for (*track, frame), (*next_track, next_frame) in zip(keys(table), keys(table)[1:], strict=False):
        assert track != next_track or next_frame == frame + 1


def test_recordings_are_named_in_local_time():
    origins = np.array([1_118_846_978_900, 1_113_436_766_900, 1_118_846_978_900, 1_118_846_980_000])
    names = name_recordings(origins).to_pylist()
    assert names == ["2005-06-15T0750", "2005-04-13T1659", "2005-06-15T0750", "2005-06-15T0750"]


def test_names_are_rounded_to_the_minute_and_times_have_bounds():
    def name(*origins):
        return name_recordings(np.array(origins)).to_pylist()

    assert name(0) == ["1969-12-31T1600"]
    assert name(29_999) == ["1969-12-31T1600"]
    assert name(30_000) == ["1969-12-31T1601"]
    assert name(0, 60_000) == ["1969-12-31T1600"] * 2
    assert name(0, 60_001) == ["1969-12-31T1600", "1969-12-31T1601"]
    assert name(4_102_444_800_000) == ["2099-12-31T1600"]
    for wrong in (-1, 4_102_444_800_001):
        with pytest.raises(ClockError):
            name(wrong)


def test_a_drifting_clock_is_refused():
    start = 1_118_846_978_900
    longest = np.arange(start, start + 60_001, 20_000)
    assert set(name_recordings(longest).to_pylist()) == {"2005-06-15T0750"}
    with pytest.raises(ClockError):
        name_recordings(np.append(longest, start + 60_001))
    with pytest.raises(ClockError):
        name_recordings(np.arange(0, 900_000, 1000))
