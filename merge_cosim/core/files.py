"""Where shipped files and generated files lie."""

import os
import tempfile
from pathlib import Path

import platformdirs

_PACKAGE = Path(__file__).parent.parent


def shipped(folder: str) -> Path:
    """Return a shipped folder such as `scenarios`: in an installed wheel in the package, else beside it."""
    inside = _PACKAGE / "_shipped" / folder
    return inside if inside.is_dir() else _PACKAGE.parent / folder


def cache_folder(*parts: str) -> Path:
    """Return (and make) a folder for generated files: `MERGE_COSIM_CACHE` or the user's cache folder."""
    root = Path(os.environ.get("MERGE_COSIM_CACHE") or platformdirs.user_cache_dir("merge-cosim"))
    folder = root.joinpath(*parts)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def write_atomically(target: Path, content: bytes) -> None:
    """Write a file so that another process sees it whole or not at all."""
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=target.name)
    with os.fdopen(handle, "wb") as file:
        file.write(content)
    Path(name).replace(target)
