"""Behaviour that every filter shares: a batch is its single filters, and a missing measurement predicts."""

import numpy as np
import pytest
from models import BOUC_WEN, COLEMAN_HODGDON

from twin.estimation.active_model import ActiveModel, KalmanActiveModel, UnscentedActiveModel
from twin.estimation.adaptive import (
    AdaptiveActiveModel,
    BiasedActiveModel,
    InteractingModels,
    RobustActiveModel,
)
from twin.estimation.ensemble import EnsembleFilter, ParticleFilter
from twin.estimation.koopman import KoopmanFilter
from twin.estimation.open_loop import OpenLoop
from twin.estimation.particle_filter import BootstrapFilter
from twin.estimation.set_membership import ErrorBound, SetMembershipFilter
from twin.estimation.tuning import ConstantGain

TIME = np.arange(60) * 0.1
PULL = np.stack([np.sin(TIME), 2 * np.sin(0.7 * TIME), 0.5 + np.cos(TIME)])
AM = ActiveModel(COLEMAN_HODGDON, 0.1)
MEMBERS = np.random.default_rng(3).normal(size=(9, 1)) * PULL[0] * 10
FILTERS = {
    "AM": AM,
    "KF": KalmanActiveModel(COLEMAN_HODGDON, 0.1),
    "UKF": UnscentedActiveModel(BOUC_WEN, 0.1),
    "Huber": RobustActiveModel(COLEMAN_HODGDON, 0.1),
    "bias": BiasedActiveModel(COLEMAN_HODGDON, 0.1),
    "gain": ConstantGain(COLEMAN_HODGDON, 0.1, gain=(0.3, 0.1)),
    "VB": AdaptiveActiveModel(AM),
    "IMM": InteractingModels((AM, ActiveModel(COLEMAN_HODGDON, 0.1, (0.1, 0.1)))),
    "PF": BootstrapFilter(COLEMAN_HODGDON, 0.1, count=50),
    "Koopman": KoopmanFilter(np.array([[1.0, 0.0], [-0.4, 0.0]]), np.array([[5.0, 0.0], [9.0, 0.0]]), 0.01),
    "ESMF": SetMembershipFilter(COLEMAN_HODGDON, 0.1, ErrorBound(1.0, 0.1)),
    "open loop": OpenLoop(COLEMAN_HODGDON),
    "ensemble": EnsembleFilter(MEMBERS),
    "particles": ParticleFilter(EnsembleFilter(MEMBERS)),
}
SHARED = ("ensemble", "particles")  # one command, and one set of missing measurements


def measured(name):
    """Pulls and measurements (3, N) with a gap, and first estimates (3,)."""
    pull = np.repeat(PULL[:1], 3, axis=0) if name in SHARED else PULL
    measurement = 20 * pull + np.random.default_rng(0).normal(size=pull.shape)
    measurement[:, 20:30] = np.nan
    if name not in SHARED:
        measurement[1, 40:45] = np.nan
    return pull, measurement, 20 * pull[:, 0] + [5.0, -3.0, 0.0]


@pytest.mark.parametrize("name", FILTERS)
def test_a_batch_is_its_single_filters_and_estimates_are_finite(name):
    pull, measurement, first = measured(name)
    batch = FILTERS[name].estimate(pull, measurement, first)
    assert np.isfinite(batch).all()
    for row in range(3):
        single = FILTERS[name].estimate(pull[row], measurement[row], first[row])
        np.testing.assert_allclose(batch[row], single[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", [name for name in FILTERS if hasattr(FILTERS[name], "predict")])
def test_a_missing_measurement_is_prediction_alone(name):
    pull, measurement, first = measured(name)
    filter_ = FILTERS[name]
    state = filter_.start(pull[:, 0], first)
    for k in range(1, 5):
        state = filter_.step(state, pull[:, k], pull[:, k - 1], measurement[:, k])
    stepped = filter_.step(state, pull[:, 5], pull[:, 4], np.full(3, np.nan))
    predicted = filter_.predict(state, pull[:, 5], pull[:, 4])
    np.testing.assert_allclose(filter_.bend_deg(stepped), filter_.bend_deg(predicted), rtol=0, atol=1e-6)
