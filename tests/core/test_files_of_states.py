"""Tables of initial states and TOML files: what is wrong is named."""

import numpy as np
import pandas as pd
import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.core.frames import states_of
from merge_cosim.core.toml_file import Table, read_toml

STATES = {"host_station": [-80.0, -90.0], "host_speed": 20.0, "merging_station": -90.0, "merging_speed": [18.0, 20.0]}


def test_columns_that_are_absent_get_their_usual_value():
    names, states = states_of(pd.DataFrame(STATES))
    assert names.tolist() == ["c0", "c1"]
    assert states["merging_speed"].tolist() == [18.0, 20.0]
    assert (states["host_length"].tolist(), states["merge_position"].tolist()) == ([5.0, 5.0], [0.0, 0.0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"host_sped": 1.0}, "unknown column 'host_sped'; did you mean 'host_speed'"),
        ({"host_speed": [20.0, -1.0]}, "column 'host_speed', row 1: .* must be a number, 0 to 100"),
        ({"host_length": 0.0}, "column 'host_length', row 0: .* must be a positive number"),
        ({"merging_station": [np.nan, 1.0]}, "column 'merging_station', row 0: nan must be a number"),
        ({"case": "a"}, "column 'case': 'a' stands there twice"),
    ],
)
def test_a_wrong_column_is_named(change, message):
    with pytest.raises(UserError, match=message):
        states_of(pd.DataFrame(STATES | change))
    with pytest.raises(UserError, match="the column 'host_station' is missing"):
        states_of(pd.DataFrame(STATES).drop(columns="host_station"))


class Inner(Table):
    width: float


class Outer(Table):
    title: str
    lane: Inner


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('titel = "a"\nlane = { width = 3 }', "titel: unknown key; did you mean 'title'"),
        ('title = "a"\nlane = { widht = 3 }', r"lane\.widht: unknown key; did you mean 'width'"),
        ('title = "a"', "lane: missing; every thing needs it"),
        ('title = "a"\nlane = { width = "x" }', r"lane\.width: "),
        ("title = ", "not valid TOML"),
    ],
)
def test_a_mistake_in_a_file_names_the_key(tmp_path, text, message):
    file = tmp_path / "thing.toml"
    file.write_text(text)
    with pytest.raises(UserError, match=message) as error:
        read_toml(file, Outer, "thing")
    assert str(error.value).startswith(f"{file}: ")


def test_given_values_stand_for_keys_that_are_left_out(tmp_path):
    (tmp_path / "thing.toml").write_text("lane = { width = 3 }")
    assert read_toml(tmp_path / "thing.toml", Outer, "thing", title="b") == Outer(title="b", lane=Inner(width=3.0))
    with pytest.raises(UserError, match=r"cannot be read .*; a thing is a folder with other\.toml"):
        read_toml(tmp_path / "other.toml", Outer, "thing")
