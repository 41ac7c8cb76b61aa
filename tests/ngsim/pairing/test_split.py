import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from trajectory_tables import steady, table

from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.ngsim.pairing.pairs import extract_pairs
from merge_cosim.ngsim.pairing.rules import PairRules
from merge_cosim.ngsim.pairing.split import folds_of, split_cars
from merge_cosim.ngsim.sites import site

US101 = site("us101")


@pytest.fixture(scope="module")
def nine_cars() -> Encounters:
    """Nine merging cars in nine recordings, with two hosts each."""
    cars = []
    for name in "abcdefghi":
        cars.append(steady(1, [6] * 30 + [5] * 10, at=0, recording=name))
        cars += [steady(host, [5] * 40, at=at, recording=name) for host, at in ((2, -10), (3, 10))]
    return extract_pairs(table(*cars), US101, PairRules(), "ngsim").encounters


@given(seed=st.integers(0, 1000), shuffle=st.integers(0, 1000))
def test_a_car_stays_on_one_side_whatever_the_order(nine_cars: Encounters, seed: int, shuffle: int) -> None:
    train = split_cars(nine_cars, seed=seed)
    assert train.sum() == 6
    assert not set(nine_cars.car[train]) & set(nine_cars.car[~train])
    order = np.random.default_rng(shuffle).permutation(len(nine_cars))
    np.testing.assert_array_equal(split_cars(nine_cars.take(order), seed=seed), train[order])


@given(seed=st.integers(0, 1000), left_out=st.integers(0, 8))
def test_one_car_less_moves_at_most_one_other(nine_cars: Encounters, seed: int, left_out: int) -> None:
    kept = np.flatnonzero(nine_cars.car != np.unique(nine_cars.car)[left_out])
    moved = split_cars(nine_cars, seed=seed)[kept] != split_cars(nine_cars.take(kept), seed=seed)
    assert len(set(nine_cars.car[kept][moved])) <= 1


def test_by_pair_and_by_seed(nine_cars: Encounters) -> None:
    assert split_cars(nine_cars, fraction=0.5, by="pair").sum() == 9
    splits = {tuple(split_cars(nine_cars, seed=seed)) for seed in range(20)}
    assert len(splits) > 5
    assert split_cars(nine_cars, fraction=0).sum() == 0
    assert split_cars(nine_cars, fraction=1).all()


def test_folds_deal_the_cars_out_evenly(nine_cars: Encounters) -> None:
    fold = folds_of(nine_cars, 4, seed=1)
    cars = {number: set(nine_cars.car[fold == number]) for number in range(4)}
    assert sorted(len(one) for one in cars.values()) == [2, 2, 2, 3]
    assert len(set.union(*cars.values())) == 9
    order = np.random.default_rng(0).permutation(len(nine_cars))
    np.testing.assert_array_equal(folds_of(nine_cars.take(order), 4, seed=1), fold[order])
    with pytest.raises(UserError, match="10 folds of 9 merging cars; choose 2 to 9"):
        folds_of(nine_cars, 10)
