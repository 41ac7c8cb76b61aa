"""Reading a TOML file into a pydantic model: a mistake in it is one line that names the file and the key."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from merge_cosim.core.errors import UserError


class Table(BaseModel):
    """A table of a file: a misspelt key is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


Model = TypeVar("Model", bound=BaseModel)


def read_toml(path: Path, model: type[Model], kind: str, **given: Any) -> Model:
    """Read and check a file.

    Args:
        path: The file, one per folder.
        model: What it must hold.
        kind: What a folder with such a file is called in messages.
        given: Values for keys that the file leaves out.

    Raises:
        UserError: The file is missing, is not TOML, or a key in it is wrong; the line names file and key.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); a {kind} is a folder with {path.name}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UserError(f"{path}: not valid TOML: {error}") from None
    try:
        # as JSON in strict mode: a list is a tuple and a text is a path, but true is no number
        return model.model_validate_json(json.dumps(given | content, default=str), strict=True)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
    except ValidationError as error:
        found = error.errors()
        first = next((each for each in found if each["type"] == "extra_forbidden"), found[0])
        key = ".".join(map(str, first["loc"]))
        reason = first["msg"].removeprefix("Value error, ")
        if first["type"] == "extra_forbidden":
            near = get_close_matches(str(first["loc"][-1]), list(_keys(model)), n=1)
            reason = f"unknown key; did you mean '{near[0]}'?" if near else "unknown key"
        elif first["type"] == "missing":
            reason = f"missing; every {kind} needs it"
        raise UserError(f"{path}: {key + ': ' if key else ''}{reason}") from None


def _keys(model: type[BaseModel]) -> Iterator[str]:
    """All keys of a model and of the tables in it."""
    for name, field in model.model_fields.items():
        yield name
        for part in (field.annotation, *get_args(field.annotation)):
            if isinstance(part, type) and issubclass(part, BaseModel):
                yield from _keys(part)
