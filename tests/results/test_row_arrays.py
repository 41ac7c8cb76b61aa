"""Result rows as arrays."""

import numpy as np
import pandas as pd

from merge_cosim.results.statistics.arrays import RowArrays

ROWS = RowArrays.of(
    pd.DataFrame(
        {
            "case": ["a", "b", "a", "c"],
            "car": ["us101/1", "", "us101/1", ""],
            "failed": [True, False, False, True],
            "censored": [False, False, False, True],
            "delay_s": [1.5, None, 0.0, 2.0],
        }
    ),
    ("failed", "censored", "delay_s"),
)


def test_rows_of_one_merging_car_belong_together_and_others_by_their_case() -> None:
    assert ROWS.clusters().tolist() == ["us101/1", "b", "us101/1", "c"]


def test_an_outcome_is_that_of_the_first_row_of_a_case() -> None:
    assert ROWS.outcomes().tolist() == [1, 0, -1]  # a failed first; c is censored
    assert ROWS.take(np.array([1, 2])).outcomes().tolist() == [0, 0, -1]  # c is not here


def test_what_is_missing_is_not_known_and_no_flag() -> None:
    assert ROWS.known("delay_s").tolist() == [True, False, True, True]
    assert ROWS.flag("failed").tolist() == [True, False, False, True]
    assert len(ROWS.take(ROWS.flag("failed"))) == 2
