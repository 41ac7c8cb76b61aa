"""Every ramp of the corpus: `python tests/ramps/corpus/drive.py` makes, checks and drives each, and prints the outcome.

Right is a ramp that is made, passes its check, and on which a small sweep in SUMO has every case, with no invariant
broken; or one that must be refused, and is, with the reason. The paths and the host's lane are compared with the right
ones by `test_corpus.py`.
"""

import json
import sys
import tempfile
from pathlib import Path

from corpus_case import Case
from corpus_maps import OSM
from corpus_nets import NETS

import merge_cosim as mc
from merge_cosim.core.errors import UserError
from merge_cosim.ramps.create.from_net import ramp_from_net
from merge_cosim.ramps.create.from_osm import ramp_from_osm
from merge_cosim.results.store import MANIFEST, ResultFolder

CASES = 20


def outcome(case: Case, folder: Path) -> str:
    """`right`, `refused` with the reason that is right, or what is wrong."""
    make = ramp_from_net if case in NETS else ramp_from_osm
    try:
        ramp = make(folder / "mine", case.make(folder), **(case.numbers or {}))
    except UserError as error:
        return "refused" if case.refused and case.refused in str(error) else f"wrong: {error}"
    if case.refused:
        return "wrong: it ought to be refused"
    out, settings = folder / "out", {"encounters.count": CASES, "ramp": str(ramp)}
    try:
        mc.sweep(["designed-random"], ["acc"], settings=settings, out=out, jobs=1, progress=False)
    except UserError as error:
        return f"wrong: {error}"
    checked = ResultFolder(out).read_json(MANIFEST)["invariants"]
    return "right" if checked["encounters"] == CASES and not any(checked["broken"].values()) else f"wrong: {checked}"


def main() -> int:
    """Run the command."""
    ends = {}
    for case in [*OSM, *NETS]:
        with tempfile.TemporaryDirectory() as scratch:
            ends[case.name] = outcome(case, Path(scratch))
    counts = {end: list(ends.values()).count(end) for end in ("right", "refused")}
    wrong = {name: end for name, end in ends.items() if end not in counts}
    print(json.dumps({"ramps": len(ends), **counts, "wrong": wrong}, indent=1))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
