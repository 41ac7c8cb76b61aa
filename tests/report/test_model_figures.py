"""Pictures of a model: what is drawn is what the model says."""

import numpy as np
import pytest
from matplotlib.patches import Ellipse

from merge_cosim.estimators.learned.model import IntentionModel
from merge_cosim.report.model_figures import (
    LONGEST_TIME,
    MOST_PANELS,
    arrival_figure,
    gaussian_figure,
    mixture_figure,
    transition_figure,
)


@pytest.fixture(scope="module")
def model():
    return IntentionModel.load("us101-ngsim")


def test_transitions_at_given_speeds(model):
    figure = transition_figure(model, speeds=[14.5, 16.5])
    assert len(figure.axes) == 2
    assert "16.5 m/s" in figure.axes[1].get_title()
    line = next(one for one in figure.axes[0].lines if one.get_label() == "mixture, not yield")
    now = line.get_xdata()
    expected = np.exp(model.speed(1).mixture.log_density(np.full(len(now), 14.5), now))[1]
    np.testing.assert_allclose(line.get_ydata(), expected)


def test_usual_speeds_were_seen_under_both(model):
    figure = transition_figure(model)
    speeds = [float(ax.get_title().split()[0]) for ax in figure.axes]
    assert 1 < len(speeds) <= MOST_PANELS
    assert all(model.speed(1).histogram.counts[:, int(speed)].sum(axis=1).min() > 0 for speed in speeds)


def test_arrivals(model):
    figure = arrival_figure(model)
    images = [ax.images[0].get_array() for ax in figure.axes if ax.images]
    bins = int(LONGEST_TIME / 0.5)
    np.testing.assert_allclose(images[0], model.arrivals.probabilities(0.05)[0, :bins, :bins] / 0.25)
    np.testing.assert_allclose(images[2], model.arrivals.log_odds(0.05)[:bins, :bins])


def test_ellipses_are_the_mixtures_components(model):
    figure = mixture_figure(model)
    ellipses = [patch for patch in figure.axes[0].patches if isinstance(patch, Ellipse)]
    assert len(ellipses) == 2 * 2
    mixture = model.speed(1).mixture
    np.testing.assert_allclose(ellipses[0].center, mixture.means[0, 0])
    # at one standard deviation, the points of an ellipse are one Mahalanobis distance from its centre
    points = ellipses[0].get_patch_transform().transform(np.array([[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]]))
    away = points - mixture.means[0, 0]
    distance = np.einsum("ni,ij,nj->n", away, np.linalg.inv(mixture.covariances[0, 0]), away)
    np.testing.assert_allclose(distance, 1.0, rtol=1e-6)


def test_gaussians(model):
    figure = gaussian_figure(model)
    steps = figure.axes[1].patches[1].get_data()
    first = int(steps.edges[0] // 5)
    np.testing.assert_array_equal(steps.values, model.speed(1).gaussian.sigma[1, first : first + len(steps.values)])


@pytest.mark.parametrize("lag", [5, 10])
def test_other_lags_are_drawn(model, lag):
    assert f"{{t-{lag}}}" in mixture_figure(model, lag).get_supxlabel()
    assert f"{{t-{lag}}}" in transition_figure(model, lag).get_supylabel()
