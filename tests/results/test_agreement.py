"""How rows of two runs are compared."""

import numpy as np
import pandas as pd

from merge_cosim.results.agreement import IS_THERE, agreement


def rows(**columns) -> pd.DataFrame:
    names = {"scenario": "s", "variation": "", "method": "acc", "model": "", "world": "sumo"}
    return pd.DataFrame({"case": ["a", "b", "c"], **columns}).assign(**names)


def test_the_same_rows_agree_in_whatever_order():
    one = rows(failed=[True, False, True], kind=["side", "", "side"], gap=[1.0, np.nan, np.inf], flips=[0, 1, 2])
    assert agreement(one, one.iloc[::-1]).empty


def test_every_kind_of_value_is_compared():
    one = rows(failed=[True, False, None], gap=[1.0, np.nan, np.inf], kind=["side", "", ""], flips=[0, 1, 2])
    other = rows(failed=[True, True, False], gap=[1.5, 0.0, -np.inf], kind=["", "", ""], flips=[0, 1, 3])
    found = agreement(one, other).set_index("column")
    assert found["differ"].to_dict() == {"failed": 2, "gap": 3, "kind": 1, "flips": 1}
    assert (found["beyond"] == found["differ"]).all()
    assert (found.loc["kind", "case"], found.loc["kind", "stored"], found.loc["kind", "again"]) == ("a", "side", "")


def test_measures_may_differ_a_little_between_worlds_and_not_within_one():
    one, other = rows(gap=[1.0, 300.0, 1.0]), rows(gap=[1.00005, 300.02, 1.0002])
    closed = one.assign(world="closed-form", sumo_collision=False)
    between = agreement(closed, other.assign(sumo_collision=True)).set_index("column").loc["gap"]
    assert (between["differ"], between["beyond"], between["case"]) == (3, 1, "c")
    assert round(between["largest"], 9) == 2e-4
    assert agreement(one, other)["beyond"].tolist() == [3]
    assert agreement(one, other, tolerance=1e-3)["beyond"].tolist() == [0]


def test_a_row_of_one_side_alone_is_a_difference():
    found = agreement(rows().iloc[:2], rows().iloc[1:])
    assert found[["column", "beyond"]].to_numpy().tolist() == [[IS_THERE, 2]]
