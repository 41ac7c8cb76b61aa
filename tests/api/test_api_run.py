"""`run`: one case alone, its row that of a sweep."""

import pandas as pd
import pytest

import merge_cosim as mc


def test_a_case_alone_is_the_case_of_the_sweep(results, tmp_path):
    run = mc.run("designed-2", case="d+0_h17_m17", method="pgm", trace=tmp_path / "trace.csv")
    swept = results.cases("case == 'd+0_h17_m17' and method == 'pgm'").iloc[0]
    assert run.row["failed"] == swept["failed"]
    assert run.row["distance_m"] == pytest.approx(swept["distance_m"], abs=1e-6)
    assert len(pd.read_csv(tmp_path / "trace.csv")) == len(run.trace) == round(swept["end_s"] / 0.1)
    assert "d+0_h17_m17" in repr(run)
    shown = run._repr_mimebundle_()["text/html"]
    assert shown.startswith("<table>")
    assert "id=&quot;viewer&quot;" in shown


def test_its_figures():
    run = mc.run("designed-2", case="d+0_h17_m17", method="acc")
    assert run.plot().axes[0].get_ylabel() == "station from the merging point [m]"
    assert run.plot("speed").axes[0].get_ylabel() == "speed [m/s]"
    with pytest.raises(mc.UserError, match="plain rule"):
        run.plot("log_odds")
    with pytest.raises(mc.UserError, match="did you mean 'speed'"):
        run.plot("sped")


def test_what_does_not_exist_is_refused():
    with pytest.raises(mc.UserError, match="no case 'd9'"):
        mc.run("designed-2", case="d9", method="acc")
    with pytest.raises(mc.UserError, match=r"written as \.csv or \.parquet"):
        mc.run("designed-2", case="d+0_h17_m17", method="acc", trace="x.txt")
