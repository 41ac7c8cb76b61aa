import pytest

from merge_cosim.controllers.law import FreeDriving
from merge_cosim.core.errors import UserError
from merge_cosim.scenarios.methods import Method
from merge_cosim.scenarios.scenario import family, load_scenario, scenario_names
from merge_cosim.scenarios.settings import parse_variation
from merge_cosim.scenarios.sources import Span


@pytest.mark.parametrize(
    ("first", "last", "step", "values"),
    [
        (1, 25, 5, [1, 6, 11, 16, 21]),  # 26 would be beyond the end
        (0, 1, 0.1, [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1]),
        (3, 3, 1, [3]),
        (-5, 5, 5, [-5, 0, 5]),
    ],
)
def test_no_value_lies_beyond_the_end(first, last, step, values):
    span = Span.model_validate({"from": first, "to": last, "step": step})
    assert span.values() == pytest.approx(values)
    assert parse_variation(f"acc.d0={first}:{last}:{step}")[1] == pytest.approx(values)


@pytest.mark.parametrize(
    ("setting", "value", "expected"),
    [
        ("encounters.demand.warm_up", 600, r"demand: warm_up \(600 s\) must be less than duration \(600 s\)"),
        ("encounters.attention.apart", -5, "apart = -5: Input should be greater than 0"),
        ("test.time_out", float("inf"), "time_out = inf: Input should be a finite number"),
    ],
)
def test_values_that_make_no_sense_are_refused(setting, value, expected):
    with pytest.raises(UserError, match=expected):
        load_scenario("traffic-light", {setting: value})


def test_a_family_is_all_shipped_scenarios_that_begin_with_its_name(tmp_path, monkeypatch):
    assert family("shifted") == [name for name in scenario_names() if name.startswith("shifted-")]
    assert family("traffic") == ["traffic-dense", "traffic-light", "traffic-stop-and-go"]
    assert family("designed-2") == ["designed-2"]
    assert family("shift") == ["shift"]  # no such scenario either
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shifted").touch()  # a file of the user's own
    assert family("shifted") == ["shifted"]


@pytest.mark.parametrize("text", ["acc.d0", "acc.d0=", "acc.d0=1:2", "acc.d0=2:1:1", "acc.d0=1:2:0", "acc.d0=1:inf:1"])
def test_what_cannot_be_varied_is_refused(text):
    with pytest.raises(UserError, match=r"--vary acc\.d0"):
        parse_variation(text)


@pytest.mark.parametrize(
    ("parameter", "value"), [("headway", float("inf")), ("k_gap", float("nan")), ("max_acceleration", 0)]
)
def test_numbers_with_which_a_host_would_never_arrive_are_refused(parameter, value):
    with pytest.raises(UserError, match=f"acc: controller acc: {parameter} = "):
        Method.of("acc", {f"acc.{parameter}": value})


def test_delays_have_a_free_driving_of_their_own():
    assert load_scenario("designed-2", {"test.free.k_free": 0.2}).test.free == FreeDriving(k_free=0.2)
    with pytest.raises(UserError, match=r"test\.free\.k_fre'; did you mean 'k_free'"):
        load_scenario("designed-2", {"test.free.k_fre": 0.2})


def test_a_horizon_without_end_is_refused():
    with pytest.raises(UserError, match=r"test\.horizon = inf: Input should be a finite number"):
        load_scenario("designed-2", {"test.horizon": float("inf")})
