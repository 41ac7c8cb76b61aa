"""Registries: components (estimators, controllers, merging cars, sensors) by name, one class in one file each."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import importlib.util
import inspect
import linecache
import pkgutil
import re
import sys
import traceback
from abc import ABC
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from difflib import get_close_matches
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, ClassVar, Generic, Self, TypeVar, dataclass_transform

import numpy as np
from pydantic import ConfigDict, PydanticInvalidForJsonSchema, TypeAdapter, ValidationError

from merge_cosim.core.errors import UserError
from merge_cosim.core.units import IntArray

LARGEST = 1e9
"""Largest number that a parameter can be: beyond it a sum in double precision is coarser than `units.TOLERANCE`."""

PLUGIN = "merge_cosim_plugin_"
"""What the name of a plugin file's module begins with."""

C = TypeVar("C", bound="Component")


@dataclass_transform(kw_only_default=True)
class Component(ABC):
    """A swappable part of a run: a dataclass whose fields are its parameters.

    A subclass that is no dataclass becomes one, with keyword parameters, when it is registered or first made.

    Attributes:
        name: The name by which the command line, scenarios and tables call it; `my-estimator` for a class
            `MyEstimator` that does not set it.
        memory: Names of what it holds for each encounter of a batch: arrays with the encounters on their last axis, or
            objects with a `thin` of their own. None: that is not known, so that a batch with it is never thinned out.
    """

    __pydantic_config__: ClassVar = ConfigDict(allow_inf_nan=False, arbitrary_types_allowed=True)
    name: ClassVar[str]
    memory: ClassVar[tuple[str, ...] | None] = None

    def __init_subclass__(cls) -> None:
        """Name the class after itself if it has no name of its own."""
        super().__init_subclass__()
        if "name" not in cls.__dict__:
            cls.name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "-", cls.__name__).lower()

    def __new__(cls, *_: Any, **__: Any) -> Self:
        """Make an object; its class is a dataclass from then on."""
        return super().__new__(_as_dataclass(cls))

    @property
    def can_thin(self) -> bool:
        """Whether `thin` is complete: no subclass of the class that names `memory` may hold more, nor is a user's."""
        classes = type(self).__mro__
        named = next(number for number, cls in enumerate(classes) if "memory" in vars(cls))
        more = any({"start", "reset"} & vars(cls).keys() for cls in classes[:named])
        own = type(self).__module__.partition(".")[0] == __name__.partition(".")[0]
        return self.memory is not None and own and not more

    def thin(self, rows: IntArray) -> None:
        """Go on with the encounters at `rows` alone, in that order; shape (m,)."""
        for name in self.memory or ():
            held = getattr(self, name)
            if isinstance(held, np.ndarray):
                setattr(self, name, held.take(rows, axis=-1))
            else:
                held.thin(rows)


def _as_dataclass(cls: type[C]) -> type[C]:
    return cls if "__dataclass_fields__" in cls.__dict__ else dataclass(kw_only=True)(cls)


class Registry(Generic[C]):
    """The components of one role, all of them subclasses of `base`, by name.

    All modules of `package` are searched on first use, then the entry points of the group `merge_cosim.<role>`.
    """

    def __init__(self, role: str, package: str, base: type) -> None:
        self.role = role
        self.base = base
        self._package = package
        self._classes: dict[str, type[C]] = {}
        self._searched = False

    def register(self, cls: type[C]) -> type[C]:
        """Class decorator: enter `cls` under its `name`; see `prepare`."""
        prepared = self.prepare(cls)
        self._classes[prepared.name] = prepared
        return cls

    def prepare(self, cls: type[C]) -> type[C]:
        """Make a class a dataclass with keyword parameters, unless it is one.

        Raises:
            UserError: It does not inherit the role's base class, it is frozen, its name cannot be written in a setting
                or is that of another class, or a method is missing or takes other arguments than it is called with.
        """
        if not (isinstance(cls, type) and issubclass(cls, self.base)):
            given, base = getattr(cls, "__name__", cls), self.base.__name__
            article = "an" if self.role[0] in "aeiou" else "a"
            raise UserError(
                f"{given}: not {article} {self.role}; give a name, a class that inherits {base}, or an object of one"
            )
        if not re.fullmatch(r"[\w-]+", cls.name):
            raise UserError(f"{_full_name(cls)}: the name '{cls.name}' must be of letters, digits, '-' and '_'")
        known = self._classes.get(cls.name)
        if known is not None and _full_name(known) != _full_name(cls):  # else its file was imported anew
            taken = f"the {self.role} name '{cls.name}' is taken by {_full_name(known)}"
            raise UserError(f"{_full_name(cls)}: {taken}; rename yours")
        if missing := sorted(getattr(cls, "__abstractmethods__", ())):
            raise UserError(f"{_full_name(cls)}: it has no method '{missing[0]}', which every {self.role} needs")
        for name, own in vars(cls).items():
            theirs = next((vars(base)[name] for base in cls.__mro__[1:] if name in vars(base)), None)
            if not name.startswith("_") and inspect.isfunction(own) and inspect.isfunction(theirs):
                try:
                    inspect.signature(own).bind(*inspect.signature(theirs).parameters)
                except TypeError as error:
                    called = f"{name}{inspect.signature(theirs)}"
                    raise UserError(f"{_full_name(cls)}.{name}: {error}; it is called as {called}") from None
        if getattr(vars(cls).get("__dataclass_params__"), "frozen", False):
            raise UserError(f"{_full_name(cls)}: a frozen dataclass cannot keep its state; leave out frozen=True")
        return _as_dataclass(cls)

    def names(self) -> list[str]:
        """All names, sorted."""
        self._search()
        return sorted(self._classes)

    def __contains__(self, name: str) -> bool:
        self._search()
        return name in self._classes

    def __getitem__(self, name: str) -> type[C]:
        self._search()
        if name not in self._classes:
            raise UserError(f"unknown {self.role} '{name}'{did_you_mean(name, self._classes)}")
        return self._classes[name]

    def build(self, name: str, values: Mapping[str, Any], where: str) -> C:
        """Make the component `name` with the given parameters; `where` begins the message about a bad one."""
        return validated(self[name], values, f"{where}: {self.role} {name}")

    def _search(self) -> None:
        if self._searched:
            return
        self._searched = True
        package = importlib.import_module(self._package)
        for module in pkgutil.iter_modules(package.__path__):
            importlib.import_module(f"{self._package}.{module.name}")
        for entry in entry_points(group=f"merge_cosim.{self.role.replace(' ', '_')}"):
            entry.load()


def _full_name(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def did_you_mean(name: str, choices: Mapping[str, Any] | list[str]) -> str:
    """The tail of a message about an unknown name: the nearest choice, and all of them."""
    near = get_close_matches(name, list(choices), n=1)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    return f"{hint} (choose from: {', '.join(sorted(set(choices))) or 'none'})"


def parameters(cls: type) -> dict[str, Any]:
    """Names and defaults of a component's parameters: its dataclass fields. `MISSING` stands for no default."""
    return {f.name: f.default if f.default_factory is MISSING else f.default_factory() for f in fields(cls) if f.init}


def described(cls: type) -> list[dict[str, Any]]:
    """Return name, default, unit, bounds and meaning of each of a component's parameters.

    The unit is the first `[unit]` of the meaning in the docstring, the bounds are those of the type hint.
    """
    try:
        schema = _adapter(cls).json_schema()["properties"]
    except PydanticInvalidForJsonSchema:  # a user's own type of parameter, whose bounds are not known
        schema = {}
    rows = []
    for name, meaning in meanings(cls).items():
        unit = re.search(r" \[([^\]]+)\]", meaning)
        default = parameters(cls)[name]
        rows.append(
            {
                "name": name,
                "default": None if default is MISSING else default,
                "unit": unit[1] if unit else "",
                "bounds": _bounds(schema.get(name, {})),
                "meaning": meaning.replace(unit[0], "", 1) if unit else meaning,
            }
        )
    return rows


def _bounds(schema: Mapping[str, Any]) -> str:
    """The values that a JSON schema allows, in words."""
    if "enum" in schema:
        return ", ".join(map(str, schema["enum"]))
    if schema.get("type") == "boolean":
        return "true, false"
    limits = [
        f"{sign} {schema[key]:g}"
        for key, sign in (("exclusiveMinimum", ">"), ("minimum", ">="), ("exclusiveMaximum", "<"), ("maximum", "<="))
        if key in schema
    ]
    return ", ".join((["whole"] if schema.get("type") == "integer" else []) + limits)


def meanings(cls: type) -> dict[str, str]:
    """What each parameter means: its entry under `Attributes:` in the docstring of its class or a base."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        _, _, attributes = inspect.cleandoc(base.__dict__.get("__doc__") or "").partition("\nAttributes:\n")
        for entry in re.split(r"\n {4}(?=\S)", "\n" + attributes)[1:]:
            names, _, meaning = entry.partition(":")
            found |= dict.fromkeys(names.split(", "), " ".join(meaning.split()))
    return {name: found.get(name, "") for name in parameters(cls)}


def source_of(cls: type) -> str:
    """The text of a class, or of the notebook cell it stands in; a hash of its code where neither is to be had."""
    try:
        return inspect.getsource(cls)
    except (OSError, TypeError):  # a class of a notebook has no file
        codes = [value.__code__ for value in vars(cls).values() if hasattr(value, "__code__")]
        written = dict.fromkeys(code.co_filename for code in codes if code.co_filename != dataclasses.__file__)
        cells = ("".join(linecache.getlines(file)) for file in written)
        held = hashlib.sha256(b"".join(code.co_code + repr(code.co_consts).encode() for code in codes))
        return next(filter(None, cells), f"# no source at hand; hash of the code: {held.hexdigest()[:16]}")


def validated(cls: type[C], values: Mapping[str, Any], where: str) -> C:
    """Make the dataclass `cls`, with its fields converted and checked by their type hints."""
    for key in values:
        if key not in parameters(cls):
            raise UserError(f"{where}: no parameter '{key}'{did_you_mean(key, parameters(cls))}")
    try:
        made: C = _adapter(cls).validate_python(dict(values))
    except ValidationError as error:
        first = error.errors()[0]
        place = f"{'.'.join(map(str, first['loc']))} = {first['input']!r}: " if first["loc"] else ""
        raise UserError(f"{where}: {place}{first['msg'].removeprefix('Value error, ')}") from None
    for key, value in values.items():
        taken = getattr(made, key)
        if isinstance(value, bool | str) and type(taken) in (int, float):
            raise UserError(f"{where}: {key} = {value!r}: Input should be a number")
        if isinstance(taken, float) and abs(taken) > LARGEST:
            raise UserError(f"{where}: {key} = {value!r}: Input should be between -{LARGEST:g} and {LARGEST:g}")
    return made


@cache
def _adapter(cls: type[C]) -> TypeAdapter[C]:
    try:
        adapter = TypeAdapter(cls)
        adapter.rebuild()  # raises where a hint names what is not there; nothing is done otherwise
        return adapter
    except Exception as error:  # a type hint may be anything, and pydantic may raise anything at it
        file = getattr(sys.modules.get(cls.__module__), "__file__", None) or cls.__module__
        reason = str(error).partition("\n")[0]
        raise UserError(f"{file}: class {cls.__name__}: a type hint cannot be used ({reason})") from None


def load_plugin(file: Path) -> None:
    """Import a user's own file, whose classes register themselves."""
    if not file.is_file():
        raise UserError(f"{file}: no such plugin file")
    imported = (getattr(module, "__file__", None) for module in tuple(sys.modules.values()))
    if any(name and Path(name).resolve() == file.resolve() for name in imported):
        return
    module_name = f"{PLUGIN}{file.stem}"
    spec = importlib.util.spec_from_file_location(module_name, file)
    if spec is None or spec.loader is None:
        raise UserError(f"{file}: not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
    except UserError:
        raise
    except (Exception, SystemExit) as error:  # whatever a user's file raises is theirs to mend
        del sys.modules[module_name]
        fault = plugin_error(error) or f"{type(error).__name__}: {error}"
        raise UserError(f"{file}: cannot be imported: {fault}") from error


def plugin_error(error: BaseException) -> UserError | None:
    """What an error that a user's own file has raised says, with the file's line; None if it comes from elsewhere."""
    walked = traceback.walk_tb(error.__traceback__)
    own = [(frame, line) for frame, line in walked if str(frame.f_globals.get("__name__")).startswith(PLUGIN)]
    if isinstance(error, UserError) or not own:
        return None
    frame, line = own[-1]
    code, text = frame.f_code, linecache.getline(frame.f_code.co_filename, line).strip()
    where = f"{code.co_filename}, line {line}, in {code.co_qualname}: {text}"
    return UserError(f"{where}: {type(error).__name__}: {error}")
