"""The search: known parameters come back from simulated logs, and a stopped one goes on."""

import numpy as np
import pytest
from calibrating import TRUTH, loops, start_of
from pickles import planted_pickle

from twin.calibration import calibrate, free_parameters


def test_known_parameters_come_back(fitted):
    free, _, fit, told = fitted
    for name in free.names:
        assert getattr(fit.preset, name) == pytest.approx(getattr(TRUTH, name), rel=0.02), name
    assert fit.cost < 1e-3
    assert told[-1][0] == told[-1][1] == 60
    assert [news[2] for news in told] == sorted((news[2] for news in told), reverse=True)


@pytest.fixture(scope="module")
def problem():
    logs = loops(1.0)
    free = free_parameters(start_of(section_stiffness=0.03), logs, ("section_stiffness", "joint_friction"))
    return free, logs


@pytest.fixture(scope="module")
def whole(problem):
    return calibrate(*problem, seed=3, evaluations=24)


def interrupt(problem, state, generations, seed=3):
    """Calibrate until so many generations are done."""
    seen = []

    def stop(*news):
        seen.append(news)
        np.random.RandomState(0).rand()
        np.random.seed(1)  # noqa: NPY002  a stream that the search must not depend on
        if len(seen) >= generations:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        calibrate(*problem, seed=seed, evaluations=24, state_file=state, on_progress=stop)
    return seen


def same(first, second):
    assert first.preset == second.preset
    assert first.cost == second.cost
    assert first.evaluations == second.evaluations
    assert first.jacobian.tobytes() == second.jacobian.tobytes()
    assert first.residual.tobytes() == second.residual.tobytes()


@pytest.mark.parametrize("generations", [(1,), (1, 1), (3,), (4,)])
def test_interrupted_calibration_ends_as_an_undisturbed_one(problem, whole, tmp_path, generations):
    state = tmp_path / "state"
    told = [interrupt(problem, state, count) for count in generations]
    seen = []
    resumed = calibrate(
        *problem, seed=3, evaluations=24, state_file=state, on_progress=lambda *news: seen.append(news)
    )
    same(resumed, whole)
    assert seen[0][0] >= told[-1][-1][0]  # nothing is simulated again


def test_state_of_another_calibration_is_not_taken_up(problem, whole, tmp_path):
    interrupt(problem, tmp_path / "state", 2, seed=4)
    same(calibrate(*problem, seed=3, evaluations=24, state_file=tmp_path / "state"), whole)


@pytest.mark.parametrize("planted", [planted_pickle, lambda witness: b"my notes"])
def test_foreign_state_is_neither_run_nor_overwritten(problem, tmp_path, planted):
    state, witness = tmp_path / ".preset.calibration", tmp_path / "it ran"
    state.write_bytes(planted(witness))
    before = state.read_bytes()
    with pytest.raises(ValueError, match="is no calibration state of EndoTwin: move it away"):
        calibrate(*problem, seed=3, evaluations=24, state_file=state)
    assert state.read_bytes() == before
    assert not witness.exists()


def test_damaged_state_is_refused(problem, tmp_path):
    state = tmp_path / "state"
    interrupt(problem, state, 2)
    content = state.read_bytes()
    for damaged in (content[:-1], content[:200], content[:-3] + b"\xff" + content[-2:]):
        state.write_bytes(damaged)
        with pytest.raises(ValueError, match="is damaged: remove it, and the run begins anew"):
            calibrate(*problem, seed=3, evaluations=24, state_file=state)


@pytest.mark.parametrize(
    ("evaluations", "seed", "rule"),
    [(19, 0, "evaluations = 19"), (10**15, 0, "at most 1000000"), (20, -1, "seed = -1"), (20, 2**32, "seed")],
)
def test_effort_that_cannot_be_is_refused(problem, evaluations, seed, rule):
    with pytest.raises(ValueError, match=rule):
        calibrate(*problem, seed=seed, evaluations=evaluations)


def test_one_parameter_is_searched_over_its_whole_range():
    logs = loops(0.0)
    free = free_parameters(start_of(sheath_bend=0.0), logs, ("sheath_friction",))
    assert calibrate(free, logs, seed=0, evaluations=24).cost >= 0  # cma limits its step, and failed there
