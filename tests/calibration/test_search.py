"""The search: known parameters come back from simulated logs, and a stopped one goes on."""

import pytest
from calibrating import TRUTH, loops, start_of

from twin.calibration import calibrate, free_parameters


def test_known_parameters_come_back(fitted):
    free, _, fit, told = fitted
    for name in free.names:
        assert getattr(fit.preset, name) == pytest.approx(getattr(TRUTH, name), rel=0.02), name
    assert fit.cost < 1e-3
    assert told[-1][0] == told[-1][1] == 60
    assert [news[2] for news in told] == sorted((news[2] for news in told), reverse=True)


def test_interrupted_calibration_goes_on_where_it_was(tmp_path):
    logs = loops(1.0)
    free = free_parameters(start_of(section_stiffness=0.03), logs, ("section_stiffness", "joint_friction"))
    whole = calibrate(free, logs, seed=3, evaluations=20)
    state = tmp_path / "state"

    def stop(done: int, total: int, cost: float) -> None:
        if done >= 6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        calibrate(free, logs, seed=3, evaluations=20, state_file=state, on_progress=stop)
    seen = []
    resumed = calibrate(
        free, logs, seed=3, evaluations=20, state_file=state, on_progress=lambda done, *_: seen.append(done)
    )
    assert resumed.preset == whole.preset
    assert seen[0] > 6
    other = calibrate(free, logs, seed=4, evaluations=20, state_file=state)  # of another seed: from the start
    assert other.evaluations == whole.evaluations or other.preset != whole.preset
