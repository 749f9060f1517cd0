"""Training of RAM (memory) end to end at small size: what it writes, how it is deployed, what it refuses."""

import dataclasses

import numpy as np
import pytest
from small_twins import MODEL, TINY_MEMORY, small_memory_step, twins

from rl.on_twins import train_ram_memory
from rl.twins.graph import export_with_model
from rl.twins.run import nominal_model
from twin.estimation.estimator import Sensor
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.load import load_estimator
from twin.hysteresis import ColemanHodgdon, model_to_dict


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    return train_ram_memory(*twins(), TINY_MEMORY, tmp_path_factory.mktemp("ram_memory"))


def exported(path, loud=1.0):
    """A file of an untrained step whose policy says something."""
    step = small_memory_step(loud=loud)
    export_with_model(step, {"agent": "ram-memory", "model": model_to_dict(MODEL)}, path)
    return step


def test_a_training_writes_what_it_was_and_a_finished_one_stays(trained):
    description = read_trained_file(trained).description
    assert description["training"]["seed"] == TINY_MEMORY.seed
    assert description["model"]["model"] == ColemanHodgdon.name
    assert load_estimator(trained).model == nominal_model(twins()[0], TINY_MEMORY.seed)
    before = trained.stat().st_mtime_ns
    train_ram_memory(*twins(), TINY_MEMORY, trained.parent)
    assert trained.stat().st_mtime_ns == before
    with pytest.raises(ValueError, match="another configuration"):
        train_ram_memory(*twins(), dataclasses.replace(TINY_MEMORY, seed=2), trained.parent)


def test_a_stream_that_restarts_keeps_what_it_knows_of_the_noise(tmp_path):
    exported(tmp_path / "policy.onnx")
    estimator = load_estimator(tmp_path / "policy.onnx").with_sensor(Sensor(1.0))
    state = estimator.start(np.zeros(2), np.zeros(2))
    for k in range(20):
        state = estimator.step(state, np.full(2, k + 1) * 0.1, np.full(2, k) * 0.1, np.full(2, 2.0 * k))
    resumed = estimator.resume(state, state, np.full(2, 2.0), state.bend_deg + np.array([0.0, 15.0]))
    np.testing.assert_array_equal(resumed.memory[2], state.memory[2])
    np.testing.assert_allclose(resumed.memory[0][:, 0] - state.memory[0][:, 0], [0, 15], atol=1e-4)
    assert resumed.memory[1][1, 0] - resumed.memory[1][0, 0] == pytest.approx(225, rel=1e-3)
