"""Counts of failures by both initial speeds."""

import numpy as np
import pandas as pd

from merge_cosim.report.failure_shares import failure_shares


def rows(host: np.ndarray, merging: np.ndarray, method: str = "acc") -> pd.DataFrame:
    return pd.DataFrame(
        {
            "method": method,
            "host_speed_0": host,
            "merging_speed_0": merging,
            "failed": host > merging,
            "host_reached": host > 6.0,
        }
    )


def test_every_cell_counts_its_cases_failures_and_absent_hosts() -> None:
    shares = failure_shares(rows(np.array([5.0, 5.0, 15.0, 15.0]), np.array([5.0, 10.0, 10.0, 10.0])))
    assert (shares.hosts.tolist(), shares.mergings.tolist()) == ([5.0, 15.0], [5.0, 10.0])
    assert shares.n["acc"].tolist() == [[1, 1], [0, 2]]
    assert shares.failed["acc"].tolist() == [[0, 0], [0, 2]]
    assert shares.absent["acc"].tolist() == [[1, 1], [0, 0]]


def test_many_speeds_are_counted_in_classes_without_losing_a_case() -> None:
    speeds = np.linspace(5.0, 25.0, 400)
    both = pd.concat([rows(speeds, speeds[::-1], method) for method in ("acc", "pgm")])
    shares = failure_shares(both)
    assert len(shares.hosts) < 40
    assert shares.n["acc"].sum() == shares.n["pgm"].sum() == 400
    assert shares.failed["acc"].sum() == 200
