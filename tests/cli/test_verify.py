"""`verify` and `sweep --verify` through the real command line."""

import json
import re
import shutil

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from command import merge_cosim, refused, small_scenario
from scene_files import small_scene

from merge_cosim.sweeps.verify import Verification


@pytest.fixture(scope="module")
def verified(tmp_path_factory):
    """A sweep of 75 cases in the closed form, verified as it ended."""
    folder = tmp_path_factory.mktemp("verified")
    ways = ("--world", "closed-form", "--jobs", "1", "--verify", "0.2", "--vary", "acc.headway=1,2")
    done = merge_cosim("sweep", small_scenario(folder), "--method", "acc,pgm", *ways, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "90 of 450 rows run again in SUMO" in done.stdout
    return folder / "out"


@pytest.fixture
def swept(verified, tmp_path):
    """A copy of its folder."""
    return shutil.copytree(verified, tmp_path / "out")


def verify(folder, *words):
    done = merge_cosim("verify", folder, "--jobs", "1", "--json", *words, cwd=folder.parent)
    return done.returncode, json.loads(done.stdout)


def rewrite(folder, change):
    table = pq.read_table(folder / "results.parquet")
    changed = change(table.to_pandas())
    rows = pa.Table.from_pandas(changed, schema=table.schema, preserve_index=False)
    pq.write_table(rows.replace_schema_metadata(table.schema.metadata), folder / "results.parquet")


@pytest.mark.slow
def test_a_changed_value_is_found_and_changed_versions_are_named(swept):
    manifest = json.loads((swept / "manifest.json").read_text())
    assert manifest["world"] == "closed-form"
    manifest["versions"]["numpy"] = "1.0"
    (swept / "manifest.json").write_text(json.dumps(manifest))
    status, found = verify(swept, "--share", "0.3", "--seed", "7")
    assert (status, found["beyond"]) == (0, 0)
    assert found["notes"][0].startswith("versions: numpy was 1.0, is ")
    rewrite(swept, lambda rows: rows.assign(failed=~rows["failed"], delay_s=rows["delay_s"] + 2e-3))
    status, found = verify(swept, "--share", "0.3", "--seed", "7")
    assert (status, found["rows"]) == (1, 132)
    beyond = {line["column"]: line["beyond"] for line in found["differences"]}
    assert beyond["failed"] == 132
    assert beyond["delay_s"] > 0
    printed = merge_cosim("verify", swept, "--jobs", 2, cwd=swept.parent).stdout
    assert "values differ beyond the tolerance" in printed
    table, values = printed.split("failed: ", 1)
    assert max(map(len, table.splitlines())) <= 80
    assert re.search(r"^delay_s: \S+ stored, \S+ again, in \w+, small, ", values, re.MULTILINE)


def test_variations_are_compared_in_80_columns(verified):
    printed = merge_cosim("compare", "out", "out", cwd=verified.parent).stdout
    assert "\nsmall acc.headway=2 (cases each: 75)\n" in printed
    assert max(map(len, printed.splitlines())) <= 80


def test_scenes_of_traffic_are_run_again_as_they_were(tmp_path):
    scenario = small_scene(tmp_path)
    done = merge_cosim("sweep", scenario, "--method", "acc", "--jobs", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    status, found = verify(tmp_path / "out", "--share", "0.4")
    assert (status, found["differences"], found["notes"]) == (0, [], [])
    scenes = pd.read_parquet(tmp_path / "out/results.parquet")["case"].str[:3]
    assert found["rows"] in set(scenes.value_counts())


def test_what_cannot_be_run_again_is_refused(swept):
    manifest = json.loads((swept / "manifest.json").read_text())
    assert (
        refused("verify", swept, "--share", "0", cwd=swept.parent)
        == "merge-cosim: share 0: must be above 0 and at most 1"
    )
    changed = manifest | {"models": {"us101-ngsim": "0"}}
    (swept / "manifest.json").write_text(json.dumps(changed))
    assert "made with another one; give its file by --model" in refused("verify", swept, cwd=swept.parent)
    (swept / "manifest.json").write_text(json.dumps(manifest))
    rewrite(swept, lambda rows: rows.assign(case=rows["case"] + "x"))
    assert "has no case 'd" in refused("verify", swept, cwd=swept.parent)


def test_what_came_out_in_one_line(tmp_path):
    differences = pd.DataFrame({"column": ["delay_s", "failed"], "beyond": [0, 2], "largest": [1e-5, 1.0]})
    assert str(Verification(tmp_path, 9, 90, differences)).endswith("2 values differ beyond the tolerance, in failed")
    assert str(Verification(tmp_path, 9, 90, differences.iloc[:0])).endswith("every value is the same")
