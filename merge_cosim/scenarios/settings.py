"""Settings: values of scenarios (`test.horizon=5`) and parameters of components (`acc.headway=1.2`)."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from merge_cosim.controllers.base import controllers
from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import Component, did_you_mean, parameters
from merge_cosim.estimators.base import estimators
from merge_cosim.scenarios.scenario import SECTIONS
from merge_cosim.scenarios.sources import steps_between

MOST_VALUES = 10_000
"""Most values of one parameter: a slip in a step is not to fill the memory."""


def split_settings(settings: Mapping[str, Any], own: Iterable[Component] = ()) -> tuple[dict[str, Any], dict[str, Any]]:
    """Part settings into those of scenarios (`test.horizon`) and those of components (`acc.headway`).

    Args:
        settings: Values by name.
        own: Components that are in no registry.

    Raises:
        UserError: A name belongs to neither.
    """
    known: dict[str, set[str]] = {}
    for part in (*(registry[name] for registry in (estimators, controllers) for name in registry.names()), *own):
        known.setdefault(part.name, set()).update(parameters(part if isinstance(part, type) else type(part)))
    of_scenario: dict[str, Any] = {}
    of_components: dict[str, Any] = {}
    for name, value in settings.items():
        owner, _, parameter = name.partition(".")
        if parameter in known.get(owner, ()):
            of_components[name] = value
        elif owner in SECTIONS:
            of_scenario[name] = value
        elif owner in known:
            raise UserError(
                f"{name}: '{owner}' has no parameter '{parameter}'{did_you_mean(parameter, [*known[owner]])}"
            )
        else:
            raise UserError(f"{name}: nothing is called '{owner}'{did_you_mean(owner, [*SECTIONS, *known])}")
    return of_scenario, of_components


def parse_value(text: str) -> Any:
    """Read a value as TOML does (numbers, true, lists); what is no TOML is a string.

    Raises:
        UserError: Lists lie in lists without an end.
    """
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text
    except RecursionError:
        raise UserError(f"{text[:20]}...: its lists are nested too deeply") from None


def parse_setting(text: str) -> tuple[str, Any]:
    """Read `NAME=VALUE`.

    Raises:
        UserError: There is no `=`.
    """
    name, equals, value = text.partition("=")
    if not equals or not name or not value:
        raise UserError(f"--set {text}: write NAME=VALUE, such as acc.headway=1.2")
    return name.strip(), parse_value(value.strip())


def parse_variation(text: str) -> tuple[str, list[Any]]:
    """Read `NAME=A:B:STEP` (B included where a step meets it) or `NAME=X,Y,Z`.

    Raises:
        UserError: It is neither.
    """
    name, equals, written = text.partition("=")
    if not equals or not name or not written:
        raise UserError(f"--vary {text}: write NAME=A:B:STEP or NAME=X,Y,Z")
    name, values = name.strip(), parse_value(written.strip())
    if not isinstance(values, str):
        return name, [values]
    if ":" not in values:
        return name, [parse_value(value.strip()) for value in values.split(",")]
    try:
        first, last, step = (float(part) for part in values.split(":"))
        count = steps_between(first, last, step)
        whole = all(part == round(part) for part in (first, step))
    except (ValueError, ZeroDivisionError, OverflowError):
        count = -1
    if not 0 <= count < MOST_VALUES or last < first:
        raise UserError(
            f"--vary {text}: write NAME=A:B:STEP with A <= B and fewer steps than {MOST_VALUES:,}, or X,Y,Z"
        )
    steps = [round(first + i * step, 9) for i in range(count + 1)]
    return name, [int(value) for value in steps] if whole else steps
