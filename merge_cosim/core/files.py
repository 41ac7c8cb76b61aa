"""Where shipped files and generated files lie."""

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import platformdirs
from filelock import FileLock

from merge_cosim.core.errors import UserError

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


def without_comma(file: Path) -> str:
    """A path for an option of SUMO's programs, which split lists of files at commas.

    Raises:
        UserError: There is one in it.
    """
    if "," in str(file):
        raise UserError(f"{file}: SUMO takes a comma for the end of a file's name; rename the file or its folder")
    return str(file)


def refuse_file(folder: Path) -> None:
    """Refuse a file where results are to be written to a folder, before anything is run for it.

    Raises:
        UserError: It is one.
    """
    if folder.exists() and not folder.is_dir():
        raise UserError(f"{folder}: is a file; --out names a folder")


def write_atomically(target: Path, content: bytes) -> None:
    """Write a file so that other processes see either the whole file or none."""
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=target.name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(name).replace(target)
    finally:
        Path(name).unlink(missing_ok=True)


def from_cache(place: Path, make: Callable[[Path], object]) -> Path:
    """Return a file or folder of the cache, made first where it is missing or damaged; see `keep`."""
    if not is_whole(place):
        keep(place, make)
    return place


def keep(place: Path, make: Callable[[Path], object]) -> None:
    """Make a file or folder of the cache, unless another process has made it meanwhile.

    It is made under another name and moved to `place` when it is whole. A digest of its content is kept beside it.

    Args:
        place: Its path; the folder exists.
        make: Function that writes it to a path.
    """
    with FileLock(_beside(place, "lock")):
        if is_whole(place):
            return
        with tempfile.TemporaryDirectory(dir=place.parent) as scratch:
            made = Path(scratch) / place.name
            make(made)
            digest = _digest(made)
            if place.exists():
                place.rename(Path(scratch) / "damaged")
            made.rename(place)
        write_atomically(_beside(place, "sha256"), digest.encode())


def is_whole(place: Path) -> bool:
    """Whether a file or folder of the cache is there, with the content that it was made with."""
    try:
        return _beside(place, "sha256").read_bytes() == _digest(place).encode()
    except OSError:
        return False


def _beside(place: Path, kind: str) -> Path:
    return place.with_name(f"{place.name}.{kind}")


def _digest(place: Path) -> str:
    """A hash of a file, or of all files of a folder and their names."""
    held = hashlib.sha256()
    for file in sorted(place.iterdir()) if place.is_dir() else [place]:
        with file.open("rb") as content:
            held.update(f"{file.name} {hashlib.file_digest(content, 'sha256').hexdigest()}\n".encode())
    return held.hexdigest()
