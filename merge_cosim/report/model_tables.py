"""What a model learned, in numbers, beside what the papers print."""

from __future__ import annotations

from typing import Any

from merge_cosim.core.encounter import Intention
from merge_cosim.core.units import FOOT
from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.report.published import PUBLISHED_MIXTURES


def gmm_table(model: IntentionModel) -> list[dict[str, Any]]:
    """Parameters of the speed mixtures at lag 1 in ft/s beside the published ones, matched by their mean speed.

    Returns:
        One row per intention, component (`slow`, `fast`) and parameter, with `published`, `ours` and the published
        one's `paper`; the variance of V_t was not published.
    """
    mixture = model.speed(1).mixture
    rows = []
    for intention in (Intention.YIELD, Intention.NOT_YIELD):
        pairs = zip(("slow", "fast"), PUBLISHED_MIXTURES[intention.name], strict=True)
        for k, (component, paper) in enumerate(pairs):  # both are ordered by their mean
            mean, covariance = mixture.means[intention, k] / FOOT, mixture.covariances[intention, k] / FOOT**2
            both: dict[str, tuple[float | None, float]] = {
                "weight": (paper.weight, mixture.weights[intention, k]),
                "mean of V_{t-1} [ft/s]": (paper.mean_before, mean[0]),
                "mean of V_t [ft/s]": (paper.mean_now, mean[1]),
                "variance of V_{t-1} [ft^2/s^2]": (paper.variance, covariance[0, 0]),
                "covariance [ft^2/s^2]": (paper.covariance, covariance[0, 1]),
                "variance of V_t [ft^2/s^2]": (None, covariance[1, 1]),
            }
            rows += [
                {
                    "intention": intention.name,
                    "component": component,
                    "parameter": parameter,
                    "published": published,
                    "ours": round(float(ours), 4),
                    "paper": paper.source,
                }
                for parameter, (published, ours) in both.items()
            ]
    return rows
