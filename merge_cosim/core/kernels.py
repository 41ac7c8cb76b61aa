"""Functions that numba compiles."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from platformdirs import user_cache_dir

Function = TypeVar("Function", bound=Callable[..., Any])
PACKAGE = Path(__file__).parents[1]
settings: Any = numba.config


def kernel(function: Function) -> Function:
    """Compile a function when it is first called, and keep its machine code on disk.

    numba itself keeps a function's code as long as the function's own file is unchanged, although the code holds the
    functions and constants of other files, too. Here the code is kept in a folder for the sources of all kernels.
    """
    chosen = settings.CACHE_DIR
    settings.CACHE_DIR = str(_root(chosen) / f"kernels-{digest(PACKAGE)}")
    try:
        return cast("Function", numba.njit(cache=True)(function))
    finally:
        settings.CACHE_DIR = chosen


@cache
def digest(package: Path) -> str:
    """A short hash of the files whose functions and constants kernels hold."""
    sources = [*sorted(package.glob("*/compiled/*.py")), package / "core" / "units.py"]
    return hashlib.sha256(b"\0".join(source.read_bytes() for source in sources)).hexdigest()[:16]


@cache
def _root(chosen: str) -> Path:
    """`$NUMBA_CACHE_DIR`, or the first of the usual places that can be written."""
    if chosen:
        return Path(chosen)
    usual = (PACKAGE / "__pycache__", Path(user_cache_dir("merge-cosim-kernels")))
    found = next(filter(_writable, usual), None)
    return found or Path(tempfile.mkdtemp(prefix="merge-cosim-"))  # its own, for what is kept there is run


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)
