import numpy as np
import pytest
from models import COLEMAN_HODGDON

from twin.estimation.open_loop import OpenLoop
from twin.hysteresis import BoucWen, PrandtlIshlinskii

PULL = 3 + np.sin(0.07 * np.arange(300))
MODELS = [
    COLEMAN_HODGDON,
    BoucWen(20.0, 5.0, 3.0, 0.8, 1.5),
    PrandtlIshlinskii((12.0, 5.0, 3.0), (0.0, 0.3, 0.8)),
]


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_measurements_do_not_touch_it_and_steps_are_the_response(model):
    alone = OpenLoop(model)
    measurement = np.random.default_rng(0).normal(60, 9, (2, len(PULL)))
    measurement[1, 4:9] = np.nan
    whole = alone.estimate(PULL, measurement, np.array([60.0, 80.0]))
    state = alone.start(np.full(2, PULL[0]), np.array([60.0, 80.0]))
    for k in range(1, len(PULL)):
        state = alone.step(state, np.full(2, PULL[k]), np.full(2, PULL[k - 1]), measurement[:, k])
        np.testing.assert_allclose(alone.bend_deg(state), whole[:, k], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(whole, alone.estimate(PULL, 0 * whole, np.array([60.0, 80.0])))
