"""Random initial states: as many as asked for, in their ranges, the same for the same seed."""

import numpy as np
import pytest

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.scenarios.encounters import load_encounters
from merge_cosim.scenarios.random_states import RandomStates
from merge_cosim.scenarios.scenario import load_scenario


def drawn(**settings) -> Encounters:
    named = {f"encounters.{name}": value for name, value in settings.items()}
    return load_encounters(load_scenario("designed-random", named), None, None)


def test_states_lie_in_their_ranges():
    encounters = drawn(count=2000)
    offset = encounters.host_station - encounters.merging_station
    for values, low, high in ((offset, -5, 5), (encounters.host_speed, 1, 25), (encounters.merging_speed, 1, 25)):
        assert low <= values.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < values.max() <= high
        assert values.mean() == pytest.approx((low + high) / 2, abs=0.03 * (high - low))
    assert len(np.unique(encounters.case)) == 2000
    assert (encounters.source == "random").all()


def test_fewer_cases_are_the_first_ones_and_another_seed_gives_others():
    many, few, other = drawn(count=500), drawn(count=200), drawn(count=200, seed=1)
    assert many.part(0, 200).digest == few.digest
    assert few.digest != other.digest
    assert few.case.tolist() == other.case.tolist()


def test_a_stretch_is_the_same_whatever_it_is_drawn_from():
    source = load_scenario("designed-random", {"encounters.count": 10_000_000}).encounters
    every = RandomStates.of(source)
    late = every.part(9_999_990, 10_000_000)
    assert late.part(3, 5).encounters().digest == late.encounters().part(3, 5).digest
    rows = np.array([9_999_999, 3, 5_000_000, 4])
    assert every.take(rows).case.tolist() == ["r9999999", "r0000003", "r5000000", "r0000004"]
    assert every.take(rows).part(0, 1).digest == late.part(9, 10).encounters().digest
    assert every.part(120, 130).encounters().digest == drawn(count=200).part(120, 130).digest
    assert [every.find("r9999999"), late.find("r9999999"), late.find("r0000001"), every.find("x")] == [
        9999999,
        9,
        None,
        None,
    ]


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("host_speed", {"from": 5, "to": 1}, "'to' is below 'from'"),
        ("host_speed", {"from": -1, "to": 5}, "a speed must not be negative"),
        ("merging_speed", {"from": 1, "to": float("inf")}, "to = inf"),
        ("count", 0, "count = 0"),
        ("count", 10_000_001, "count = 10000001"),
        ("cout", 5, "did you mean 'count'"),
    ],
)
def test_mistakes_are_named(name, value, expected):
    with pytest.raises(UserError, match=expected):
        drawn(**{name: value})
