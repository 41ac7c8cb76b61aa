"""Initial states in a table of the user's own."""

import numpy as np
import pandas as pd
import pytest

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError

STATES = {"host_station": [-80.0, -90.0], "host_speed": 20, "merging_station": -90.0, "merging_speed": [18.0, 20.0]}


def test_columns_become_encounters():
    more = {"case": ["b", "a"], "host_length": 4.0, "merge_position": [0.0, 30.0]}
    encounters = Encounters.from_frame(pd.DataFrame(STATES | more))
    assert encounters.case.tolist() == ["b", "a"]
    assert encounters.host_speed.tolist() == [20.0, 20.0]
    assert encounters.host_length.tolist() == [4.0, 4.0]
    assert encounters.merging_length.tolist() == [5.0, 5.0]
    assert encounters.merge_position.tolist() == [0.0, 30.0]
    assert encounters.source.tolist() == ["designed"] * 2


def test_cases_get_names_in_the_order_of_the_rows():
    many = pd.DataFrame(STATES).iloc[[0] * 11]
    assert Encounters.from_frame(many).case.tolist() == [f"c{i:02d}" for i in range(11)]
    assert set(Encounters.from_frame(many, sample=True).source) == {"random"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hostspeed": 1.0}, "unknown column 'hostspeed'; did you mean 'host_speed'"),
        ({"host_speed": [1.0, -1.0]}, "column 'host_speed', row 1: -1.0 must be a number, 0 to 100"),
        ({"host_speed": ["fast", "1"]}, "column 'host_speed', row 0: 'fast' must be a number"),
        ({"merging_station": np.nan}, "column 'merging_station', row 0"),
        ({"host_length": 0.0}, "must be a positive number"),
        ({"case": ["a", "a"]}, "'a' stands there twice"),
    ],
)
def test_what_cannot_be_is_refused(change, message):
    with pytest.raises(UserError, match=message):
        Encounters.from_frame(pd.DataFrame(STATES | change))


def test_a_missing_column_and_no_row_are_refused():
    with pytest.raises(UserError, match="'host_station' is missing"):
        Encounters.from_frame(pd.DataFrame(STATES).drop(columns="host_station"))
    with pytest.raises(UserError, match="no row"):
        Encounters.from_frame(pd.DataFrame(STATES).iloc[:0])
