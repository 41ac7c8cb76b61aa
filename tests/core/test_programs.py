"""Running other programs: a time limit, and an end with everything that they have started."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.core.programs import PACKAGES, run_program

FAMILY = "sleep 60 & echo $! $$ > pids.new; mv pids.new pids; wait"
"""A shell and its child."""

CALLER = f"""
import signal
from pathlib import Path
from merge_cosim.cli.interrupts import ended_by_signal
from merge_cosim.core.programs import run_program
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where the tests run in the background
ended_by_signal()
run_program(["sh", "-c", {FAMILY!r}], 60.0, Path("file"))
"""


def alive(pid: int) -> bool:
    """Whether a process runs (one that has ended and was not asked for its status does not)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def pids(folder: Path) -> list[int]:
    """Both processes, as soon as they run."""
    until = time.monotonic() + 30
    while not (folder / "pids").exists():
        assert time.monotonic() < until
        time.sleep(0.02)
    return [int(word) for word in (folder / "pids").read_text().split()]


def assert_ended(folder: Path) -> None:
    until = time.monotonic() + 10
    while any(alive(pid) for pid in pids(folder)):
        assert time.monotonic() < until
        time.sleep(0.02)


def test_a_program_that_takes_too_long_is_ended(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"^my\.net\.xml: sh was still at it after 0.5 s"):
        run_program(["sh", "-c", FAMILY], 0.5, Path("my.net.xml"), cwd=tmp_path)
    assert_ended(tmp_path)


def test_what_a_program_leaves_behind_is_ended_too(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="sh was still at it"):
        run_program(["sh", "-c", "sleep 60 & echo $! $$ > pids.new; mv pids.new pids"], 0.5, tmp_path, cwd=tmp_path)
    assert_ended(tmp_path)


def test_what_it_says_and_its_status(tmp_path: Path) -> None:
    done = run_program(["sh", "-c", "echo out; echo err >&2; exit 3"], 10.0, tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (3, b"out\n", b"err\n")
    with pytest.raises(UserError, match=r"nothing: cannot be started"):
        run_program([str(tmp_path / "nothing")], 10.0, tmp_path)


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_a_signal_ends_the_program_too(tmp_path: Path, number: int) -> None:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, "-c", CALLER], cwd=tmp_path, env=environment, stderr=subprocess.DEVNULL
    ) as caller:
        pids(tmp_path)
        caller.send_signal(number)
        status = caller.wait(20)
    assert status == (143 if number == signal.SIGTERM else -number)
    assert_ended(tmp_path)


def test_a_missing_system_library_is_reported_with_its_package() -> None:
    said = (
        "netconvert: error while loading shared libraries: libatomic.so.1: cannot open shared object file: No such file"
    )
    with pytest.raises(UserError, match=r"needs the system library libatomic\.so\.1; .* apt-get install .*libatomic1"):
        run_program(["sh", "-c", f"echo {said!r} >&2; exit 127"], 60.0, Path("file"))
    assert run_program(["sh", "-c", "echo other >&2; exit 127"], 60.0, Path("file")).returncode == 127
    dockerfile = (Path(__file__).parents[2] / "Dockerfile").read_text()
    assert all(f" {package} " in dockerfile for package in PACKAGES.split())
