"""The page on the use from Python: every snippet runs, in order, as one program."""

import re
from pathlib import Path

import merge_cosim as mc

PAGE = Path(__file__).parent.parent / "docs" / "python.md"


def test_every_snippet_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    text = PAGE.read_text(encoding="utf-8").replace("jobs=2", "jobs=1")
    for number, block in enumerate(re.findall(r"```python\n(.*?)```", text, re.DOTALL)):
        exec(compile(block, f"snippet {number}", "exec"), names)
    assert names["own"].methods == ["acc", "cautious", "cautious+lqr"]
    assert set(names["own"].manifest["components"]) == {"cautious"}
    assert (tmp_path / "out.html").is_file()
    assert len(names["run"].trace)
    assert names["mine"].compare("pgm", "acc")["p"].notna().all()


def test_every_name_of_the_face_that_the_page_mentions_is_there():
    mentioned = set(re.findall(r"\bmc\.(\w+)", PAGE.read_text(encoding="utf-8")))
    assert mentioned <= set(mc.__all__)
    assert {"sweep", "run", "train", "Encounters"} <= mentioned
