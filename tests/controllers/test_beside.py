"""A driver beside the host lane: when it has the room to come in, and what the planner does about it."""

import numpy as np
import pytest

from merge_cosim.controllers.compiled.beside import has_room, note_room
from merge_cosim.controllers.rollout import POLICIES, Rollout
from merge_cosim.core.observation import Observation, Setting

LIMIT, FAR = 29.0, np.inf


def planner(**values):
    made = Rollout(**values)
    made.start(1, Setting(LIMIT))
    made.reset(np.arange(1))
    return made


def drive(made, host, host_speed, speed, around=(FAR, 0.0, 40.0)):
    """The command to a host [m/s^2] with its front at `host`, and a car whose front is 0.1 m before the point."""
    seen = Observation(*(np.array([float(v)]) for v in (host, host_speed, -0.1, speed, 5, 5)))
    made.look_around(np.array(around)[:, None])
    return float(made.command(seen, np.zeros(1), np.ones(1, bool))[0])


@pytest.mark.parametrize(
    ("host", "host_speed", "speed", "lead", "lead_speed", "room"),
    [
        (-19.1, 10, 10, FAR, 0, True),  # d0 and 1.2 s behind its rear: 2 + 12 + 5 m
        (-18.9, 10, 10, FAR, 0, False),
        (-24, 12, 8, FAR, 0, False),  # 21.4 m, and 10 m that the host stops later
        (-32, 12, 8, FAR, 0, True),
        (-19.1, 10, 10, 1.9, 10, False),  # less than d0 to the car ahead of the host
        (-19.1, 10, 10, 2.1, 10, True),
        (-19.1, 10, 10, 8, 6, False),  # that is slower, and stops 8 m earlier
        (0, 10, 10, FAR, 0, False),  # beside it
        (6.9, 10, 10, FAR, 0, False),  # its rear 1.9 m past
        (7.1, 10, 10, FAR, 0, True),
        (7.1, 6, 10, FAR, 0, False),  # but slower
    ],
)
def test_room_to_come_in_by_hand(host, host_speed, speed, lead, lead_speed, room):
    law = planner()._host_law
    state = np.repeat([host, host_speed, 0, speed, 5, 5, 0, 0, 0, 40.0, lead, lead_speed], 2).reshape(-1, 2)
    assert has_room(*(float(v) for v in (host, host_speed, 5, 0, speed, 5, lead, lead_speed)), law) == room
    offered = np.array([0.3, 0.3])
    note_room(state, offered, 0.1, law)
    np.testing.assert_allclose(offered, 0.4 if room else 0.3)


def test_a_car_at_the_merging_point_is_planned_for_as_without_other_cars():
    there, without = planner(), planner()
    without._around[:] = [[FAR], [0.0], [0.0]]
    for around in ((30.0, 5.0, 0.0), (FAR, 0.0, 0.0)):
        drive(there, -20, 10, 5, around)
        drive(without, -20, 10, 5, (FAR, 0.0, 0.0))
        np.testing.assert_array_equal(there.last_costs, without.last_costs)


def test_what_the_time_of_the_driver_costs_is_the_courtesy():
    """A driver who stands a length ahead comes in at once: its time does not depend on the weight that it has."""
    costs = []
    for courtesy in (0.0, 1.0, 3.0):
        made = planner(courtesy=courtesy)
        drive(made, -20, 5, 0, (FAR, 0.0, 0.1))
        costs.append(made.last_costs[0, :, 3])
        np.testing.assert_array_equal(np.delete(made.last_costs[0], 3, axis=1)[0], np.full(5, made.last_costs[0, 0, 3]))
    came = costs[1] - costs[0]
    assert (came > 5.0).all()
    np.testing.assert_allclose(costs[2] - costs[0], 3.0 * came)


def test_a_host_in_a_queue_lets_a_driver_in_who_would_stop_beside_it():
    """Both at 12 m/s, 40 m before a queue that moves at 3 m/s and 30 m before the end of the driver's lane."""
    queue = 40.0, 3.0, 30.0
    braking = [drive(planner(courtesy=courtesy), -13, 12, 12, queue) for courtesy in (1.0, 0.0)]
    assert braking[0] <= -1.0
    assert braking[1] >= 0.0


def test_nobody_waits_for_ever_for_a_driver_who_has_the_room_and_does_not_come():
    made = planner()
    commands = [drive(made, -7.5, 0.0, 0.0, (FAR, 0.0, 0.1)) for _ in range(100)]
    assert made._offered[0] == pytest.approx(10.0)
    assert commands[-1] > 0.0
    assert POLICIES[made.last_policy[0]] in ("free", "accelerate 1", "accelerate 2")
