"""The machine code of kernels is kept for the sources of all of them."""

from pathlib import Path

import numba
import pytest

from merge_cosim.core import kernels
from merge_cosim.core.kernels import PACKAGE, digest, kernel


def plus_one(value: float) -> float:
    return value + 1.0


def test_code_is_kept_for_the_sources_of_all_kernels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    compiled = kernel(plus_one)
    assert compiled(1.0) == 2.0
    assert digest(PACKAGE) in compiled.stats.cache_path
    assert list(tmp_path.glob(f"kernels-{digest(PACKAGE)}/*/*.nbc"))
    assert str(tmp_path) == numba.config.CACHE_DIR


@pytest.mark.parametrize("edited", ["estimators/compiled/drivers.py", "core/units.py"])
def test_an_edit_of_any_source_makes_them_anew(tmp_path: Path, edited: str) -> None:
    copies = tmp_path / "before", tmp_path / "after"
    for copy in copies:
        for source in (*PACKAGE.glob("*/compiled/*.py"), PACKAGE / "core/units.py"):
            target = copy / source.relative_to(PACKAGE)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(source.read_bytes())
    assert digest(copies[0]) == digest(PACKAGE)
    with (copies[1] / edited).open("a") as file:
        file.write("# edited\n")
    assert digest(copies[1]) != digest(PACKAGE)


def test_a_package_that_cannot_be_written_keeps_its_code_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "package").touch()  # not even root can make a folder in it
    monkeypatch.setattr(kernels, "PACKAGE", tmp_path / "package")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert (tmp_path / "home") in kernels._root.__wrapped__("").parents
