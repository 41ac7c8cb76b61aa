"""Files of a result folder: whole or not at all, and one line where one is damaged."""

import pyarrow as pa
import pytest

from merge_cosim.core.errors import UserError
from merge_cosim.results.files import is_whole, read_json, read_table, replacing, require, write_table


def test_a_key_that_is_not_there_names_the_file(tmp_path):
    file = tmp_path / "manifest.json"
    file.write_text('{"a": {"b": 1}}')
    document = read_json(file)
    assert document["a"]["b"] == 1
    with pytest.raises(UserError, match=r"manifest\.json: damaged \(no 'c'\)"):
        document["a"]["c"]


def test_a_table_is_read_as_written_and_half_a_table_is_damaged(tmp_path):
    file, rows = tmp_path / "rows.parquet", pa.table({"a": [1, 2], "b": ["x", "y"]})
    write_table(file, rows)
    assert is_whole(file)
    assert read_table(file, ["b"]).column_names == ["b"]
    require(file, rows.schema, [pa.field("a", pa.int64())])
    with pytest.raises(UserError, match="no column 'a' of type double"):
        require(file, rows.schema, [pa.field("a", pa.float64())])
    file.write_bytes(file.read_bytes()[:-9])
    assert not is_whole(file)
    with pytest.raises(UserError, match="damaged"):
        read_table(file)


def test_an_interrupted_write_leaves_the_file_as_it_was(tmp_path):
    file = tmp_path / "summary.csv"
    file.write_text("before")

    def interrupted():
        with replacing(file) as unfinished:
            unfinished.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert file.read_text() == "before"
