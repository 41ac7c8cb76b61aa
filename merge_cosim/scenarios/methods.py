"""Methods: an estimator and a controller, named `pgm` or `pgm+lqr`, with parameters from the command line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any, TypeVar, cast

from merge_cosim.controllers.base import Controller, controllers
from merge_cosim.controllers.policy import Policy
from merge_cosim.core.encounter import Encounters
from merge_cosim.core.errors import UserError
from merge_cosim.core.registry import Component, Registry, parameters, validated
from merge_cosim.estimators.base import Estimator, estimators
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.sensors.base import Sensor
from merge_cosim.sensors.perfect import Perfect
from merge_cosim.simulation.host_driver import HostDriver

ORACLE_BEST = "oracle-best"
"""The better of always-go and always-yield on each case: a row made by the statistics, no estimator."""
HUMAN = "human"
"""The logged host itself, on replay: rows made from the log, no estimator."""
CONSTANT = ("always-go", "always-yield")
"""The methods that `oracle-best` chooses from."""
POLICY = "policy:"
"""What the name of a method begins with that is a file of weights."""
REFERENCES = (*CONSTANT, "always-brake", "oracle-label", ORACLE_BEST, HUMAN)
"""What bounds the methods: constant decisions, oracles and the logged host. They do not compete."""

C = TypeVar("C", bound=Component)
MethodPart = str | Component | type[Component]
"""An estimator or a controller: its name, its class or an object of it. Neither class nor object need be registered."""
MethodSpec = MethodPart | tuple[MethodPart, MethodPart]
"""A method as a user names it: `pgm`, `pgm+lqr`, an estimator, a controller, or a pair of the two."""


@dataclass(frozen=True)
class Method:
    """A named pair of an estimator and a controller, with all their parameters.

    Attributes:
        name: As the user wrote it; of objects, the name of the estimator, or `estimator+controller`.
        estimator, controller: Names of the two.
        values: Every parameter in effect, by `component.parameter`.
        objects: The two where their classes are not registered or they hold more than parameters; else None.
    """

    name: str
    estimator: str
    controller: str
    values: tuple[tuple[str, Any], ...] = ()
    objects: tuple[Estimator | None, Controller | None] = field(default=(None, None), compare=False, repr=False)

    def __hash__(self) -> int:
        return hash((self.name, self.estimator, self.controller))  # a value may be a list

    @classmethod
    def of(cls, spec: MethodSpec, settings: Mapping[str, Any] | None = None) -> Method:
        """Make a method of what a user named.

        Args:
            spec: A name (`pgm`, `pgm+lqr`), an estimator, a controller (with its `default_estimator`), or a pair of an
                estimator and a controller; each as a name, a class or an object.
            settings: Parameters by `component.parameter`; those of other components are left out.

        Raises:
            UserError: A component is unknown, or a parameter is wrong or disagrees with one that it is taken from.
        """
        if isinstance(spec, str) and spec == HUMAN:
            return cls(HUMAN, HUMAN, "")
        settings = settings or {}
        first, second, name = _parts(spec)
        estimator, estimator_object = _make(estimators, first, settings, name)
        chosen = second or estimator.default_controller
        controller, controller_object = _make(controllers, chosen, settings, name)
        name = name or (f"{estimator.name}+{controller.name}" if second else estimator.name)
        _take_over(name, estimator, controller, settings)
        values = [(f"{part.name}.{key}", getattr(part, key)) for part in (estimator, controller) for key in _keys(part)]
        if len(dict(values)) < len(values):
            raise UserError(f"{name}: its estimator and its controller are both '{estimator.name}'; rename one of them")
        objects = estimator_object, controller_object
        return cls(name, estimator.name, controller.name, tuple(values), objects)

    @property
    def is_human(self) -> bool:
        """It is the logged host, which needs no method."""
        return self.name == HUMAN

    @property
    def needs_model(self) -> bool:
        """Its estimator rests on a trained model."""
        return not self.is_human and self._estimator.needs_model

    @property
    def needs_label(self) -> bool:
        """Its estimator looks at the label."""
        return not self.is_human and self._estimator.needs_label

    @property
    def _estimator(self) -> Estimator | type[Estimator]:
        return self.objects[0] or estimators[self.estimator]

    @property
    def _controller(self) -> Controller | type[Controller]:
        return self.objects[1] or controllers[self.controller]

    def parameters(self) -> dict[str, Any]:
        """Every parameter in effect, by `component.parameter`."""
        return dict(self.values)

    def classes(self) -> list[type[Component]]:
        """The classes of its estimator and its controller; none of the logged host."""
        parts = () if self.is_human else (self._estimator, self._controller)
        return [part if isinstance(part, type) else type(part) for part in parts]

    def driver(self, model: IntentionModel | None, sensor: Sensor | None = None) -> HostDriver:
        """Make the two parts anew; `model` goes to an estimator that needs one. Without a sensor the truth is seen."""
        made_estimator, made_controller = deepcopy(self.objects)
        estimator = made_estimator or estimators.build(self.estimator, self._of(self._estimator), self.name)
        controller = made_controller or controllers.build(self.controller, self._of(self._controller), self.name)
        if estimator.needs_model and model is not None:
            estimator.use(model)
        return HostDriver(estimator, controller, sensor or Perfect())

    def _of(self, part: Component | type[Component]) -> dict[str, Any]:
        return _own(self.parameters(), part)


def _parts(spec: MethodSpec) -> tuple[MethodPart, MethodPart | None, str]:
    """Estimator, controller (None for the estimator's own) and the method's name, empty where it is not written."""
    if isinstance(spec, str) and spec.startswith(POLICY):
        return Policy.default_estimator, Policy(file=spec.removeprefix(POLICY)), spec
    if isinstance(spec, str):
        first, _, second = spec.partition("+")
        return first, second or None, spec
    if isinstance(spec, tuple) and len(spec) == 2:
        return *spec, ""
    part = spec if isinstance(spec, type) else type(spec)
    if issubclass(part, Controller):
        return part.default_estimator, spec, ""
    return spec, None, ""


def _make(registry: Registry[C], part: MethodPart, settings: Mapping[str, Any], where: str) -> tuple[C, C | None]:
    """A component with its settings; and once more, unless its name and parameters are enough to make it anew."""
    if isinstance(part, str):
        return registry.build(part, _own(settings, registry[part]), where), None
    cls = registry.prepare(cast("type[C]", part if isinstance(part, type) else type(part)))
    try:
        made = cls() if isinstance(part, type) else cast("C", deepcopy(part))
    except TypeError as error:
        raise UserError(f"{cls.__name__}: give an object instead of the class: {error}") from None
    chosen = _own(settings, made)
    checked = validated(cls, {key: getattr(made, key) for key in _keys(made)} | chosen, cls.__name__)
    for key in chosen:
        setattr(made, key, getattr(checked, key))
    by_name = made.name in registry and registry[made.name] is cls and set(vars(made)) <= set(_keys(made))
    return made, None if by_name else made


def _take_over(name: str, estimator: Estimator, controller: Controller, settings: Mapping[str, Any]) -> None:
    """Give a controller the parameters that it takes from the estimator; refuse others of its own."""
    for key, value in controller.taken_from(estimator).items():
        own, known = getattr(controller, key), f"{controller.name}.{key}"
        if own != value and (known in settings or own != parameters(type(controller))[key]):
            owner = f"{estimator.name}.{key}"
            raise UserError(
                f"{name}: {known} = {own!r} disagrees with {owner} = {value!r}, which it is taken from; set {owner}"
            )
        setattr(controller, key, value)


def _keys(part: Component) -> list[str]:
    return list(parameters(type(part)))


def _own(settings: Mapping[str, Any], part: Component | type[Component]) -> dict[str, Any]:
    """The parameters of one component, by their names."""
    names = parameters(part if isinstance(part, type) else type(part))
    return {name: settings[key] for name in names if (key := f"{part.name}.{name}") in settings}


def default_methods() -> list[str]:
    """Every registered estimator, with the papers' rivals and the references."""
    return [*estimators.names(), ORACLE_BEST, HUMAN]


def methods_for(encounters: Encounters, methods: Iterable[Method]) -> list[Method]:
    """The methods that can run on these encounters: `oracle-label` needs labels, `human` a log."""
    labelled = bool((encounters.label >= 0).any())
    return [
        method
        for method in methods
        if (labelled or not method.needs_label) and (encounters.log is not None or not method.is_human)
    ]


def refuse_unused(settings: Mapping[str, Any], methods: Iterable[Method]) -> None:
    """Refuse parameters that no method has.

    Raises:
        UserError: There is one.
    """
    known = {key for method in methods for key in method.parameters()}
    for name in settings:
        if name not in known:
            others = sorted(key for key in known if key.partition(".")[2] == name.partition(".")[2])
            hint = f"set {' or '.join(others)}" if others else "leave it out"
            raise UserError(f"{name}: no chosen method has this parameter; {hint}, or choose another method")


def is_reference(method: str) -> bool:
    """Whether a method only bounds the others."""
    return method.partition("+")[0] in REFERENCES
