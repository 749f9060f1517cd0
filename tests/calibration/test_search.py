"""The search: known parameters come back from simulated logs, and a stopped one goes on."""

import dataclasses

import numpy as np
import pytest
from calibrating import SAMPLE_TIME, TRUTH, changed, loops, noisy, recorded, start_of
from pickles import planted_pickle

from twin.calibration import calibrate, free_parameters, measured_loop, search, with_slack
from twin.calibration.objective import channels, residuals
from twin.calibration.search import Stages


def test_known_parameters_come_back(fitted):
    free, _, fit, reports = fitted
    for name in free.names:
        assert getattr(fit.preset, name) == pytest.approx(getattr(TRUTH, name), rel=0.02), name
    assert fit.cost < 1e-3
    assert fit.neighbours.shape[1] == 1 + len(free.names)
    assert fit.neighbours[:, 0].min() > -1e-5
    assert reports[-1][0] == reports[-1][1] == len(reports)
    assert [news[2] for news in reports] == sorted((news[2] for news in reports), reverse=True)


@pytest.fixture(scope="module")
def problem():
    logs = loops(1.0)
    free = free_parameters(start_of(section_stiffness=0.03), logs, ("section_stiffness", "joint_friction"))
    return [free], logs


@pytest.fixture(scope="module")
def whole(problem):
    return calibrate(*problem, seed=3, starts=2)


def interrupt(problem, state, stages, seed=3):
    """Calibrate until so many stages are done."""
    seen = []

    def stop(*news):
        seen.append(news)
        np.random.RandomState(0).rand()
        np.random.seed(1)  # noqa: NPY002  a stream that the search must not depend on
        if len(seen) >= stages:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        calibrate(*problem, seed=seed, starts=2, state_file=state, on_progress=stop)
    return seen


def same(first, second):
    assert first.preset == second.preset
    assert first.cost == second.cost
    assert first.reduced_cost == second.reduced_cost
    assert first.jacobian.tobytes() == second.jacobian.tobytes()
    assert first.residual.tobytes() == second.residual.tobytes()
    assert first.neighbours.tobytes() == second.neighbours.tobytes()


@pytest.mark.parametrize("stages", [(1, 1), (3,)])
def test_interrupted_calibration_ends_as_an_undisturbed_one(problem, whole, tmp_path, stages):
    state = tmp_path / "state"
    reports = [interrupt(problem, state, count) for count in stages]
    resumed = calibrate(*problem, seed=3, starts=2, state_file=state)
    same(resumed, whole)
    assert [len(seen) for seen in reports] == list(stages)


def test_a_fit_that_mujoco_cannot_follow_is_that_of_the_reduced_twin(problem, whole, monkeypatch):
    monkeypatch.setattr(search, "predict", lambda presets, logs, *_: [[None] * len(logs) for _ in presets])
    fit = calibrate(*problem, seed=3, starts=2)
    assert fit.unconfirmed.startswith(f"the twin diverges in MuJoCo along {problem[1][0].name}")
    for name in fit.free.names:
        assert getattr(fit.preset, name) == pytest.approx(getattr(whole.preset, name), rel=0.01)
    assert fit.cost == fit.reduced_cost
    assert fit.jacobian.shape == (len(fit.residual), len(fit.free.names))


@pytest.mark.parametrize("planted", [planted_pickle, lambda witness: b"my notes"])
def test_foreign_state_is_neither_run_nor_overwritten(problem, tmp_path, planted):
    state, witness = tmp_path / ".preset.calibration", tmp_path / "it ran"
    state.write_bytes(planted(witness))
    before = state.read_bytes()
    with pytest.raises(ValueError, match="is no calibration state of EndoTwin"):
        calibrate(*problem, seed=3, starts=2, state_file=state)
    assert state.read_bytes() == before
    assert not witness.exists()


def test_damaged_state_is_refused(problem, tmp_path):
    state = tmp_path / "state"
    interrupt(problem, state, 2)
    content = state.read_bytes()
    for damaged in (content[:-1], content[:200], content[:-3] + b"\xff" + content[-2:]):
        state.write_bytes(damaged)
        with pytest.raises(ValueError, match="is damaged"):
            calibrate(*problem, seed=3, starts=2, state_file=state)


@pytest.mark.parametrize(
    ("starts", "seed", "rule"),
    [(0, 0, "starts = 0"), (10**15, 0, "1000"), (2, -1, "seed = -1"), (2, 2**32, "seed")],
)
def test_effort_that_cannot_be_is_refused(problem, starts, seed, rule):
    with pytest.raises(ValueError, match=rule):
        calibrate(*problem, seed=seed, starts=starts)


def test_channels_weigh_by_their_noise_where_nothing_else_is_left():
    logs = noisy(5e-3, 5e-2)
    free = free_parameters(start_of(wire_offset=2.2e-3), logs, ("wire_offset", "section_stiffness"))
    fit = calibrate([free], logs, seed=0, starts=1)
    left = [fit.residual[place] for of_log in channels(logs) for place in of_log]
    power = [float(one @ one) for one in left]
    assert max(power) < 1.5 * min(power)
    usual = residuals([fit.preset], logs)
    assert fit.cost == pytest.approx((usual**2).sum())


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_walk_ends_in_the_lower_of_two_valleys(problem, monkeypatch, side):
    """The second valley is out of reach of a descent: a ridge of residuals lies between."""
    (free,), logs = problem
    reports = []

    def penalised(fitted, points, *args, **options):
        x, y = (np.array([free.encode(fitted.decode(point)) for point in points]) - free.start).T
        high = 0.1 * np.cos(np.pi * x / 0.3) ** 2 + 0.5 * (x - 0.45 * side) ** 2
        return np.stack([np.sqrt(high + 0.3), 3 * y, *np.full((6, len(x)), 1e-3)], axis=1)

    for module in ("search", "descent"):
        monkeypatch.setattr(f"twin.calibration.{module}.penalised", penalised)
    searching = search._Search([free], logs, 2, Stages(9, None, "", lambda *news: reports.append(news)))
    start = free.start - np.array([0.15 * side, 0.0])
    before = float((penalised(free, [start])[0] ** 2).sum())
    cost, found = searching.walk(0, 0, start, weight=0.0)
    assert cost < 0.7 * before
    assert (found - free.start)[0] * side == pytest.approx(0.45, abs=0.02)


@pytest.mark.parametrize("side", [-1, 1])
def test_the_lower_valley_has_an_initial_bend_of_either_sign(problem, monkeypatch, side):
    """A log of slack wires may begin at either end of their plateau; a descent ends on its own side."""
    _, logs = problem
    free = free_parameters(start_of(), logs, ("joint_friction", "initial_bend"))

    def penalised(_, points, *args, **options):
        friction, bend = (np.array(points) - free.start).T
        higher = 0.1 * (np.sign(bend) != side)
        return np.stack([np.abs(bend) - 0.5, friction, np.sqrt(0.3 + higher)], axis=1)

    monkeypatch.setattr("twin.calibration.descent.penalised", penalised)
    for begun in (-0.5, 0.5):
        searching = search._Search([free], logs, 2, Stages(9, None, "", None))
        ((cost, which, numbers),) = searching.descend(
            "finish", [(0, free.start + np.array([0.1, begun]))], 60
        )
        assert free.decode(numbers).initial_bend == pytest.approx(0.1 * begun, abs=1e-3)
        cost, _, numbers = searching.mirror(cost, which, numbers)
        assert cost == pytest.approx(0.3, abs=1e-6)
        assert free.decode(numbers).initial_bend == pytest.approx(0.05 * side, abs=1e-3)


@pytest.mark.slow
def test_wires_with_slack_are_chosen_where_the_logs_show_a_plateau():
    slack = TRUTH.replace(wire_slack=8e-4, command_zero=3e-4)
    logs = [measured_loop(recorded(slack, cycles=2.3), "slack", SAMPLE_TIME)]
    logs = [changed(log, tension=np.empty((len(log.seen), 0))) for log in logs]
    names = ("joint_friction", "wire_offset", "wire_stiffness", "pretension")
    taut = free_parameters(start_of(wire_stiffness=2e3), logs, names)
    fit = calibrate([taut, with_slack(taut)], logs, seed=0, starts=4)
    assert fit.preset.wire_slack == pytest.approx(8e-4, rel=0.05)
    assert fit.preset.command_zero == pytest.approx(3e-4, abs=3e-5)
    assert fit.free.names[-2:] == ("wire_slack", "command_zero")


def test_delay_and_lag_of_the_drive_come_back_although_the_angle_has_an_offset():
    truth = TRUTH.replace(command_delay=0.06, servo_gain=15.0)
    episode = recorded(truth, cycles=2.3)
    seen = dataclasses.replace(episode, measured_bend=episode.bend + 0.05)
    log = dataclasses.replace(measured_loop(seen, "late", SAMPLE_TIME), offset=True)
    free = free_parameters(
        start_of(command_delay=0.02, servo_gain=30.0), [log], ("command_delay", "servo_gain")
    )
    fit = calibrate([free], [log], seed=0, starts=2)
    assert fit.preset.command_delay == pytest.approx(0.06, abs=0.002)
    assert fit.preset.servo_gain == pytest.approx(15.0, rel=0.05)
