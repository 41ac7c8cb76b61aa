import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.pairing.rules import PairRules, cycles


def test_seconds_to_cycles() -> None:
    assert (cycles(0.5), cycles(2.0), cycles(0.3)) == (5, 20, 3)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"smoothing_window": 10}, "smoothing_window"),
        ({"smoothing_window": 1}, "smoothing_window"),
        ({"observed_window": 1}, "observed_window"),
        ({"max_window": 1.0}, "max_window"),
        ({"min_window": 0.0}, "min_window"),
    ],
)
def test_impossible_rules_are_refused(change: dict[str, object], named: str) -> None:
    with pytest.raises(UserError, match=named):
        PairRules(**change)
