"""The environments: they are what Gymnasium expects, and what is driven in them is judged as in a sweep."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import merge_cosim as mc
from merge_cosim.core.colors import HOST, MERGING, rgba
from merge_cosim.core.features import FEATURES
from merge_cosim.gym import NAME
from merge_cosim.gym.drawing import LANE, Drawing, body
from merge_cosim.gym.env import MergeEnv
from merge_cosim.gym.episodes import Episodes
from merge_cosim.gym.settings import Options, Reward
from merge_cosim.gym.vector import MergeVectorEnv

FEW = {"encounters.count": 40}
AGREED = {"decision_flips", "correct_at_merge", "first_stable_s"}
"""Measures of decisions, which a commanded acceleration does not show; and the beliefs at the gates."""


def acc_acceleration(state):
    """What `acc` drives, from the law itself."""
    host, merging, host_speed, merging_speed, _, length = state
    free = 0.4 * (29.0 - host_speed)
    behind = 0.23 * (merging - length - host - (2.0 + 1.5 * host_speed)) + 0.6 * (merging_speed - host_speed)
    return np.clip(np.where(merging - host >= -1e-6, np.minimum(behind, free), free), -4.0, 2.0)


def acc_decision(state):
    return (state[1] - state[0] >= -1e-6).astype(np.int64)


def rows_of(env, policy, cases):
    """The rows of some cases under a policy, by case."""
    env.reset(seed=0, options={"cases": cases})
    rows, open_ = {}, np.ones(len(cases), dtype=bool)
    while open_.any():
        *_, terminated, truncated, info = env.step(policy(env.episodes.state))
        for slot in np.flatnonzero((terminated | truncated) & open_):
            row = {name: values[slot] for name, values in info["final_info"].items() if name[0] != "_"}
            rows[row["case"]] = row
        open_ &= ~(terminated | truncated)
    return rows


@pytest.fixture(scope="module")
def swept():
    results = mc.sweep("designed-3", methods=["acc"], settings=FEW, world="closed-form", jobs=1)
    return {row["case"]: row for row in results.rows.to_dict("records")}


@pytest.mark.parametrize(("action", "policy"), [("acceleration", acc_acceleration), ("decision", acc_decision)])
def test_the_law_of_acc_gives_the_rows_of_a_sweep(swept, action, policy):
    env = MergeVectorEnv(num_envs=40, measures=True, settings=FEW, action=action)
    rows = rows_of(env, policy, list(swept))
    assert set(rows) == set(swept)
    hidden = AGREED if action == "acceleration" else set()
    for case, row in rows.items():
        for name, value in row.items():
            wanted = swept[case][name]
            if name == "method" or name in hidden or (hidden and name.startswith(("log_odds", "arrival_lead"))):
                continue
            assert value == wanted or (value is None and wanted != wanted), (case, name)


@pytest.mark.parametrize("world", ["closed-form", "sumo"])
def test_one_encounter_gives_the_row_of_a_sweep(swept, world):
    env = gymnasium.make(NAME, settings=FEW, world=world).unwrapped
    case = list(swept)[7]
    _, info = env.reset(options={"case": case})
    assert info == {"case": case}
    over = False
    while not over:
        *_, terminated, truncated, info = env.step(acc_acceleration(env.episodes.state))
        over = terminated or truncated
    assert info["world"] == world
    assert info["failed"] == swept[case]["failed"]
    for name in ("delay_s", "distance_m", "min_gap_m", "end_s", "hardest_braking"):
        assert info[name] == pytest.approx(swept[case][name], abs=1e-5)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step([0.0])
    env.close()


@pytest.mark.parametrize("action", ["acceleration", "decision"])
def test_gymnasium_finds_nothing_wrong(action):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", ".*symmetric and normalized.*|.*infinity.*")  # ours are in SI units
        env = gymnasium.make(NAME, settings=FEW, action=action, render_mode="rgb_array")
        check_env(env.unwrapped)


def test_vectors_are_those_of_gymnasium():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make_vec(NAME, num_envs=64, vectorization_mode="vector_entry_point", settings=FEW)
    assert isinstance(env.unwrapped, MergeVectorEnv)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    seen, _ = env.reset(seed=5)
    env.action_space.seed(5)
    actions = [env.action_space.sample() for _ in range(150)]
    first, ended = [seen], 0
    for action in actions:
        seen, reward, terminated, truncated, info = env.step(action)
        assert seen in env.observation_space
        assert reward.shape == terminated.shape == truncated.shape == (64,)
        assert not (terminated & truncated).any()
        over = terminated | truncated
        if over.any():
            assert (info["_final_obs"] == over).all()
            assert (info["final_info"]["_failed"] == over).all()
            assert all(last in env.single_observation_space for last in info["final_obs"][over])
            assert (info["final_info"]["failed"] <= terminated).all()
        ended += over.sum()
        first.append(seen)
    assert ended > 40
    assert (env.reset(seed=5)[0] == first[0]).all()
    assert all((env.step(action)[0] == seen).all() for action, seen in zip(actions, first[1:], strict=True))
    assert (env.reset()[0] != first[0]).any()


def test_the_time_stands_when_an_encounter_has_ended():
    env, steps, over = MergeEnv(settings=FEW), 0, False
    env.reset(seed=0)
    while not over:
        *_, terminated, truncated, _ = env.step(np.array([0.0], dtype=np.float32))
        over, steps = terminated or truncated, steps + 1
    assert env.episodes.time[0] == pytest.approx(0.1 * steps)
    env.reset(seed=0)
    assert env.episodes.time[0] == 0.0


def test_what_runs_into_the_time_out_is_truncated():
    env = MergeEnv(settings=FEW)
    env.reset(seed=1)
    steps = [env.step(np.array([-4.0]))[2:4] for _ in range(400)]
    assert steps[:-1] == [(False, False)] * 399
    assert steps[-1] == (False, True)


def test_the_reward_is_the_sum_of_its_parts():
    weights = {"overlap": 7.0, "progress": 2.0, "comfort": 0.5}
    env = MergeVectorEnv(num_envs=40, settings=FEW, reward=weights, observation=["host_speed"])
    before, _ = env.reset(seed=0)
    failures = 0
    for _ in range(200):
        after, reward, *_, info = env.step(np.full((40, 1), 1.5))
        if info:
            after = np.where(info["_final_obs"][:, None], np.stack([*map(last_or, info["final_obs"], after)]), after)
        failed = info["final_info"]["failed"] if info else np.zeros(40, dtype=bool)
        wanted = -7.0 * failed - 0.2 * (1.0 - after[:, 0] / 29.0) - 0.05 * ((after - before)[:, 0] / 0.1) ** 2
        assert reward == pytest.approx(wanted, abs=1e-4)
        failures += failed.sum()
        before = env.episodes.features.T
    assert failures
    assert Options(reward=weights).weights == Reward(7.0, 2.0, 0.5)


def last_or(last, now):
    return now if last is None else last


def test_observations_are_the_features():
    env = MergeEnv(observation=FEATURES, scenario="designed-2")
    seen, info = env.reset(options={"case": "d+1_h15_m14"})
    assert info["case"] == "d+1_h15_m14"
    host, host_speed, merging, merging_speed, host_arrival, merging_arrival, gap, lead = seen
    assert (host_speed, merging_speed, lead) == (15.0, 14.0, -1.0)
    assert (host_arrival, merging_arrival) == (np.float32(-host / 15.0), np.float32(-merging / 14.0))
    assert gap == -4.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scenario": "designed-4"}, "unknown scenario 'designed-4'"),
        ({"observation": ["host_sped"]}, "no feature 'host_sped'; did you mean 'host_speed'"),
        ({"observation": []}, "no feature is named"),
        ({"action": "steer"}, "choose 'acceleration' or 'decision'"),
        ({"reward": {"speed": 1.0}}, "the weights are overlap, progress and comfort, not speed"),
        ({"settings": {"sensing.model": "radar"}}, "without a sensor; leave out sensing"),
        ({"scenario": "traffic-dense", "world": "sumo"}, "one host and one merging car"),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(mc.UserError, match=message):
        Episodes(Options(**options), 1, measures=False, endless=False)


def test_wrong_cases_and_actions_are_refused():
    env = MergeVectorEnv(num_envs=2, settings=FEW)
    with pytest.raises(mc.UserError, match="no case 'x'"):
        env.reset(options={"cases": ["x", "y"]})
    with pytest.raises(mc.UserError, match="the numbers of scenario designed-3 are 0 to 39"):
        env.reset(options={"cases": [0, 40]})
    env.reset(seed=0)
    with pytest.raises(mc.UserError, match="holds NaN"):
        env.step([[0.0], [np.nan]])


def test_cars_are_drawn_where_they_are():
    assert body(10.0, 5.0, on_ramp=False).tolist() == [[10, -0.95], [10, 0.95], [5, 0.95], [5, -0.95]]
    assert body(-60.0, 5.0, on_ramp=True)[:, 1].max() < -LANE
    frame = Drawing("main").frame(np.array([-50.0, -60.0, 15.0, 14.0, 5.0, 5.0]), 1.2)
    assert frame.shape == (220, 800, 3)
    host_color, merging_color = (rgba(color)[:3] for color in (HOST, MERGING))
    host, merging = (np.argwhere((frame == color).all(axis=2)) for color in (host_color, merging_color))
    assert host[:, 0].min() < merging[:, 0].min()  # the main road is above the ramp
    turned = Drawing("ramp").frame(np.array([-60.0, -50.0, 14.0, 15.0, 5.0, 5.0]), 1.2)
    assert np.argwhere((turned == host_color).all(axis=2))[:, 0].min() == merging[:, 0].min()
    column = host[host[:, 1] < 510, 1].mean()
    assert abs(column / 800 * 160 - (100.0 - 2.5)) / 160 < 0.02
