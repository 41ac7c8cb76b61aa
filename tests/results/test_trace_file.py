"""The records of a result folder: pieces joined in the order of their names, and read by case."""

from pathlib import Path

import pandas as pd
import pyarrow as pa

from merge_cosim.results.traces import _TRACE, TraceFile


def records(case: str, cycles: int, **further: float) -> pa.Table:
    texts = {"scenario": "grid", "case": case, "method": "acc"}
    columns = {field.name: [texts.get(field.name, 1.0)] * cycles for field in _TRACE}
    rows = pd.DataFrame(columns | {name: [value] * cycles for name, value in further.items()})
    return pa.Table.from_pandas(rows, preserve_index=False)


def test_pieces_are_joined_by_name_and_kept_where_that_is_asked_for(tmp_path: Path) -> None:
    traces = TraceFile(tmp_path)
    traces.begin(keep=False)
    traces.add("1", records("later", 2))
    traces.add("0", records("earlier", 3, cost_s=4.0))  # a column that the other piece lacks
    traces.join()
    assert traces.recorded()["case"].tolist() == ["earlier", "later"]
    assert traces.read([("grid", "earlier")])["cost_s"].to_pylist() == [4.0] * 3
    assert traces.read([("grid", "later")])["cost_s"].to_pylist() == [None] * 2
    traces.begin(keep=True)
    traces.add("2", records("last", 1))
    traces.join()
    assert traces.recorded()["case"].tolist() == ["earlier", "later", "last"]
    assert not (tmp_path / "records").exists()
