"""The mixtures in numbers, beside the published ones."""

import math

import pytest

from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.studies.papers.tables import mixture as mixture_table


def test_mixtures_are_matched_by_mean_and_in_feet():
    model = IntentionModel.load("us101-ngsim")
    rows = {(r["intention"], r["component"], r["parameter"]): r for r in mixture_table(model).data.to_dict("records")}
    assert len(rows) == 2 * 2 * 6
    mixture = model.speed(1).mixture
    assert mixture.means[1, 0, 0] < mixture.means[1, 1, 0]
    slow = rows["NOT_YIELD", "slow", "mean of V_{t-1} [ft/s]"]
    assert slow["ours"] == pytest.approx(mixture.means[1, 0, 0] / 0.3048, abs=1e-3)
    assert slow["published"] == 17.87  # printed second in the paper
    assert rows["YIELD", "fast", "covariance [ft^2/s^2]"]["published"] == 106.77
    fast = rows["YIELD", "fast", "covariance [ft^2/s^2]"]["ours"]
    assert fast == pytest.approx(mixture.covariances[0, 1, 0, 1] / 0.3048**2, abs=1e-3)
    assert math.isnan(rows["YIELD", "slow", "variance of V_t [ft^2/s^2]"]["published"])
