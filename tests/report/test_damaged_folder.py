"""A result folder in which something is missing or of another kind: one line that names it."""

import json
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from merge_cosim.api.results import Results
from merge_cosim.core.errors import UserError


@pytest.fixture
def folder(swept: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(swept, tmp_path / "out"))


@pytest.mark.parametrize("key", ["settings", "models", "variations", "versions", "command", "world"])
def test_a_manifest_without_a_key(folder: Path, key: str) -> None:
    file = folder / "manifest.json"
    manifest = json.loads(file.read_text())
    file.write_text(json.dumps({name: value for name, value in manifest.items() if name != key}))
    with pytest.raises(UserError, match=rf"manifest\.json: damaged \(no '{key}'\); run the sweep again"):
        Results(folder).report()


def test_a_manifest_that_is_nested_without_an_end(folder: Path) -> None:
    (folder / "manifest.json").write_text("[" * 100_000)
    with pytest.raises(UserError, match=r"manifest\.json: damaged"):
        Results(folder).report()


@pytest.mark.parametrize(
    ("name", "column"), [("traces", "log_odds"), ("traces", "case"), ("results", "failed"), ("results", "host_speed_0")]
)
def test_a_table_without_a_column_or_with_another(folder: Path, name: str, column: str) -> None:
    file = folder / f"{name}.parquet"
    table = pq.read_table(file)
    at = table.schema.get_field_index(column)
    lists = pa.array([[1.0]] * len(table))
    for other in (
        table.drop_columns([column]),
        table.set_column(at, column, lists),
        table.append_column(table.schema.field(at), table[column]),
    ):
        pq.write_table(other.replace_schema_metadata(table.schema.metadata), file)
        with pytest.raises(UserError, match=rf"{name}\.parquet: damaged \((no column '{column}' of|.*duplicate)"):
            Results(folder).report()
