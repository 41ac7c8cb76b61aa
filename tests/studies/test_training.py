"""Training refuses what makes no model; tests/cli/test_train.py trains on real pairs."""

import pytest

from merge_cosim.api.studies import train as train_in_python
from merge_cosim.core.errors import UserError
from merge_cosim.studies.training import train


def test_a_model_file_ends_in_json(tmp_path):
    with pytest.raises(UserError, match=r"m\.txt: a model file ends in \.json"):
        train("us101", None, "surrogate", "car", 0, tmp_path / "m.txt")
    with pytest.raises(UserError, match=r"m\.txt: a model file ends in \.json"):
        train_in_python(tmp_path / "m.txt", source="surrogate")


def test_real_pairs_need_real_data(tmp_path):
    with pytest.raises(UserError, match="MERGE_COSIM_DATA"):
        train("us101", None, "ngsim", "car", 0, tmp_path / "m.json")
    assert not any(tmp_path.iterdir())
