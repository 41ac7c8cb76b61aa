"""Registries: names are unique, and parameters are checked."""

from dataclasses import dataclass
from typing import ClassVar

import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import Component, Registry


def parts() -> Registry[Component]:
    """A registry of parts, none of which is found by itself."""
    return Registry("part", "merge_cosim.bench")


def part(title: str) -> type[Component]:
    """A class that calls itself `one`, under a title of its own in the code."""

    @dataclass(kw_only=True)
    class Part(Component):
        name: ClassVar[str] = "one"
        size: float = 1.0

    Part.__qualname__ = title
    return Part


def test_a_name_that_is_taken_is_refused_even_within_a_file() -> None:
    registry = parts()
    registry.register(part("First"))
    anew = registry.register(part("First"))  # as when its file is imported once more
    assert registry["one"] is anew
    with pytest.raises(UserError, match=r"Second: the part name 'one' is taken by .*First; rename yours"):
        registry.register(part("Second"))


def test_parameters_are_converted_and_checked() -> None:
    registry = parts()
    registry.register(part("First"))
    assert vars(registry.build("one", {"size": 2}, "here")) == {"size": 2.0}
    for values, line in (
        ({"size": "x"}, r"here: part one: size = 'x'"),
        ({"size": float("nan")}, r"size = nan: Input should be a finite number"),
        ({"sise": 1}, r"no parameter 'sise'; did you mean 'size'"),
    ):
        with pytest.raises(UserError, match=line):
            registry.build("one", values, "here")
    with pytest.raises(UserError, match=r"unknown part 'on'; did you mean 'one'"):
        registry["on"]
