"""Methods: an estimator and a controller, named `pgm` or `pgm+lqr`, with parameters from the command line."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from merge_cosim.controllers.base import controllers
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import did_you_mean, parameters
from merge_cosim.estimators.base import estimators
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.scenarios.scenario import SECTIONS
from merge_cosim.scenarios.sources import steps_between
from merge_cosim.simulation.host_driver import HostDriver

ORACLE_BEST = "oracle-best"
"""The better of always-go and always-yield on each case: a row made by the statistics, no estimator."""
HUMAN = "human"
"""The logged host itself, on replay: rows made from the log, no estimator."""
CONSTANT = ("always-go", "always-yield")
"""The methods that `oracle-best` chooses from."""


MOST_VALUES = 10_000
"""Most values of one parameter: a slip in a step is not to fill the memory."""


@dataclass(frozen=True)
class Method:
    """A named pair of an estimator and a controller, with the parameters that were set.

    Attributes:
        name: As the user wrote it.
        estimator, controller: Names of the two.
        settings: Parameters by `component.parameter`.
    """

    name: str
    estimator: str
    controller: str
    settings: tuple[tuple[str, Any], ...] = ()

    @classmethod
    def parse(cls, name: str, settings: Mapping[str, Any] | None = None) -> Method:
        """Read `estimator` or `estimator+controller`.

        Raises:
            UserError: One of them is unknown, or a parameter is wrong.
        """
        if name == HUMAN:
            return cls(HUMAN, HUMAN, "", tuple(sorted((settings or {}).items())))
        estimator, _, controller = name.partition("+")
        chosen = controller or estimators[estimator].default_controller
        method = cls(name, estimator, chosen, tuple(sorted((settings or {}).items())))
        method.driver(None)
        return method

    @property
    def is_human(self) -> bool:
        """It is the logged host, who needs no method."""
        return self.name == HUMAN

    @property
    def needs_model(self) -> bool:
        """Its estimator rests on a trained model."""
        return not self.is_human and estimators[self.estimator].needs_model

    @property
    def needs_label(self) -> bool:
        """Its estimator looks at the label."""
        return not self.is_human and estimators[self.estimator].needs_label

    def driver(self, model: IntentionModel | None) -> HostDriver:
        """Make the two parts; `model` goes to an estimator that needs one."""
        estimator = estimators.build(
            self.estimator, self._values(self.estimator, estimators[self.estimator]), self.name
        )
        controller = controllers.build(
            self.controller, self._values(self.controller, controllers[self.controller]), self.name
        )
        if estimator.needs_model and model is not None:
            estimator.use(model)
        return HostDriver(estimator, controller)

    def _values(self, component: str, cls: type) -> dict[str, Any]:
        names = (key.partition(".") for key, _ in self.settings)
        values = {
            name: value for (owner, _, name), (_, value) in zip(names, self.settings, strict=True) if owner == component
        }
        return {name: value for name, value in values.items() if name in parameters(cls)}


def default_methods() -> list[str]:
    """Every registered estimator, with the papers' rivals and the references."""
    return [*estimators.names(), ORACLE_BEST, HUMAN]


def methods_for(encounters: Encounters, methods: Iterable[Method]) -> list[Method]:
    """The methods that can run on these encounters: who looks at labels needs some, and the human host needs a log."""
    labelled = bool((encounters.label >= 0).any())
    return [
        method
        for method in methods
        if (labelled or not method.needs_label) and (encounters.log is not None or not method.is_human)
    ]


def split_settings(settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Part settings into those of scenarios (`test.horizon`) and those of components (`acc.headway`).

    Raises:
        UserError: A name belongs to neither.
    """
    of_scenario: dict[str, Any] = {}
    of_components: dict[str, Any] = {}
    for name, value in settings.items():
        owner, _, parameter = name.partition(".")
        classes = [registry[owner] for registry in (estimators, controllers) if owner in registry]
        if any(parameter in parameters(cls) for cls in classes):
            of_components[name] = value
        elif owner in SECTIONS and owner != "name":
            of_scenario[name] = value
        elif classes:
            known = sorted({one for cls in classes for one in parameters(cls)})
            raise UserError(f"{name}: '{owner}' has no parameter '{parameter}'{did_you_mean(parameter, known)}")
        else:
            choices = [*SECTIONS, *estimators.names(), *controllers.names()]
            raise UserError(f"{name}: nothing is called '{owner}'{did_you_mean(owner, choices)}")
    return of_scenario, of_components


def parse_value(text: str) -> Any:
    """Read a value as TOML does (numbers, true, lists); what is no TOML is a string."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


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
    except (ValueError, ZeroDivisionError, OverflowError):
        count = -1
    if not 0 <= count < MOST_VALUES:
        raise UserError(
            f"--vary {text}: write NAME=A:B:STEP with A <= B and fewer steps than {MOST_VALUES:,}, or X,Y,Z"
        )
    whole = all(part == round(part) for part in (first, step))
    steps = [round(first + i * step, 9) for i in range(count + 1)]
    return name, [int(value) for value in steps] if whole else steps
