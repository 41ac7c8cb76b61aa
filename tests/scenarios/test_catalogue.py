"""The list of everything that is registered."""

from merge_cosim.controllers.base import controllers
from merge_cosim.estimators.base import estimators
from merge_cosim.merging_cars.base import merging_cars
from merge_cosim.scenarios.catalogue import components
from merge_cosim.sensors.base import sensors


def test_every_component_is_listed_once_with_its_parameters():
    rows = components()
    named = [(row["role"], row["name"]) for row in rows]
    assert len(set(named)) == len(named)
    for registry in (estimators, controllers, merging_cars, sensors):
        assert [name for role, name in named if role == registry.role] == registry.names()
    assert [name for role, name in named if role == "derived"] == ["oracle-best", "human"]
    assert all(row["about"] for row in rows)
    acc = next(row for row in rows if (row["role"], row["name"]) == ("controller", "lqr"))
    assert acc["parameters"]["headway"] == 1.5
