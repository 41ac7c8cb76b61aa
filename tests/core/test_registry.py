"""Registries: names are unique, and parameters are checked."""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import pytest
from pydantic import Field

from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import Component, Registry, described


def parts() -> Registry[Component]:
    """A registry of parts, none of which is found by itself."""
    return Registry("part", "merge_cosim.bench", Component)


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


def test_a_plain_class_becomes_a_part_under_its_own_name() -> None:
    registry = parts()

    @registry.register
    class TwoWordsHTTPPart(Component):
        size: float = 1.0

    assert registry.build("two-words-http-part", {"size": 2}, "here").size == 2.0
    assert TwoWordsHTTPPart(size=3.0).size == 3.0

    class Larger(TwoWordsHTTPPart):  # not registered: a dataclass once it is made
        room: float = 5.0

    assert vars(Larger(size=3.0, room=4.0)) == {"size": 3.0, "room": 4.0}
    assert Larger.name == "larger"
    with pytest.raises(UserError, match=r"the name 'a\.b' must be of letters"):
        registry.register(type("Dotted", (Component,), {"name": "a.b"}))


def test_parameters_are_described() -> None:
    class Described(Component):
        """A part.

        Attributes:
            size: Its size [m], as a whole [cm].
            share: A share.
            kind: Which.
            parts: Some.
        """

        size: Annotated[int, Field(gt=0)]
        share: Annotated[float, Field(ge=0, lt=1)] = 0.5
        kind: Literal["a", "b"] = "a"
        parts: list[int] = field(default_factory=lambda: [1])
        on: bool = True

    rows = {row.pop("name"): row for row in described(parts().register(Described))}
    assert rows["size"] == {
        "default": None,
        "unit": "m",
        "bounds": "whole, > 0",
        "meaning": "Its size, as a whole [cm].",
    }
    assert rows["share"] == {"default": 0.5, "unit": "", "bounds": ">= 0, < 1", "meaning": "A share."}
    assert rows["kind"]["bounds"] == "a, b"
    assert (rows["parts"]["default"], rows["parts"]["bounds"]) == ([1], "")
    assert rows["on"] == {"default": True, "unit": "", "bounds": "true, false", "meaning": ""}


def test_what_is_no_class_of_the_role_is_refused() -> None:
    def rule() -> None: ...

    expected = r"not a part; give a name, a class that inherits Component, or an object of one"
    for given, name in ((rule, "rule"), (dict, "dict")):
        with pytest.raises(UserError, match=f"^{name}: {expected}$"):
            parts().register(given)
