"""Calibration: known parameters come back from simulated logs, and what the logs do not tell is said."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.calibration import calibrate, free_parameters, likely_ranges, measured_loop, uncertainty
from twin.calibration.matching import best_coleman_hodgdon, match, training_commands
from twin.calibration.objective import BEND_SCALE, TENSION_SHARE, predict, residuals
from twin.calibration.parameters import DEFAULT, FreeParameters
from twin.calibration.report import fit_figure, fit_report
from twin.dataset.episodes import make_episode
from twin.dataset.recipe import EpisodeKey, Recipe
from twin.episode import Episode
from twin.hysteresis import ColemanHodgdon
from twin.physics import simulate
from twin.preset.preset import Preset

SAMPLE_TIME = 0.05  # [s]
TRUTH = Preset(
    "truth",
    vertebrae=3,
    section_stiffness=0.025,
    joint_friction=1e-3,
    wire_offset=2e-3,
    wire_stiffness=3e3,
    pretension=5.0,
    sheath_elements=2,
    sheath_friction=0.25,
    sheath_bend=1.0,
    sheath_friction_floor=0.5,
)


def recorded(preset: Preset = TRUTH, cycles: float = 1.3, **changes) -> Episode:
    phase = np.arange(0, cycles * 4.0, SAMPLE_TIME) / 4.0
    return simulate(preset.replace(**changes), 4e-3 * np.sin(2 * np.pi * phase), SAMPLE_TIME)


def loops(*bends: float):
    return [measured_loop(recorded(sheath_bend=bend), f"{bend:g} rad", SAMPLE_TIME) for bend in bends]


def start_of(**changes) -> Preset:
    return TRUTH.replace(name="start", **changes)


@pytest.fixture(scope="module")
def fitted():
    logs = loops(0.0, 1.5)
    free = free_parameters(
        start_of(sheath_friction=0.15, wire_stiffness=2e3, section_stiffness=0.04),
        logs,
        ("section_stiffness", "wire_stiffness", "sheath_friction"),
    )
    told = []
    fit = calibrate(free, logs, seed=0, evaluations=120, on_progress=lambda *news: told.append(news))
    return free, logs, fit, told


def test_ranges_of_a_fit_hold_it_and_are_wide_where_the_logs_tell_nothing(fitted):
    free, _, fit, _ = fitted
    known = uncertainty(fit, free)
    for name, low, high in likely_ranges(fit, free, known).limits:
        assert low < getattr(fit.preset, name) < high
        assert high / low < 1.2
    blind = dataclasses.replace(known, deviation=dict.fromkeys(free.names, np.inf))
    for name, low, high in likely_ranges(fit, free, blind).limits:
        assert high / low == pytest.approx(9, rel=1e-3), name


def test_known_parameters_come_back(fitted):
    free, _, fit, told = fitted
    for name in free.names:
        assert getattr(fit.preset, name) == pytest.approx(getattr(TRUTH, name), rel=0.02), name
    assert fit.cost < 1e-3
    assert told[-1][0] == told[-1][1] == 120
    assert [news[2] for news in told] == sorted((news[2] for news in told), reverse=True)


def test_truth_costs_nothing_and_residuals_are_in_units_of_the_bars():
    logs = loops(0.5)
    assert (residuals([TRUTH], logs) ** 2).sum() < 1e-12
    off = TRUTH.replace(initial_bend=0.2)
    (episode,), values = predict([off], logs)[0], residuals([off], logs)[0]
    bend = np.mean((episode.bend - logs[0].bend) ** 2) / BEND_SCALE**2
    share = TENSION_SHARE * np.ptp(logs[0].tension)
    tension = np.mean((episode.tension - logs[0].tension) ** 2) / share**2
    assert (values**2).sum() == pytest.approx(bend + tension)


def test_report_compares_with_each_log_and_draws_it(fitted):
    free, logs, fit, _ = fitted
    values, episodes = fit_report(fit, free, uncertainty(fit, free), logs, seed=0)
    assert [log["name"] for log in values["logs"]] == ["0 rad", "1.5 rad"]
    for log in values["logs"]:
        assert log["rmse_deg"] < 0.05 < log["coleman_hodgdon_rmse_deg"]
        assert log["tension_a_rmse_percent_of_range"] < 1
    axes = fit_figure(logs, episodes).axes
    assert len(axes) == 4
    np.testing.assert_allclose(axes[0].lines[0].get_ydata(), np.degrees(logs[0].bend))


def test_log_that_is_only_predicted_is_scored_apart(fitted):
    free, logs, fit, _ = fitted
    shown = [logs[0], logs[1].only_predicted()]
    values, _ = fit_report(fit, free, uncertainty(fit, free), shown, seed=0)
    seen, unseen = values["logs"]
    assert seen["held_out_rmse_deg"] is None
    assert unseen["rmse_deg"] is None
    assert unseen["coleman_hodgdon_rmse_deg"] is None
    assert unseen["held_out_rmse_deg"] < 0.05
    assert unseen["tension_a_rmse_percent_of_range"] < 1


def test_interrupted_calibration_goes_on_where_it_was(tmp_path):
    logs = loops(1.0)
    free = free_parameters(start_of(section_stiffness=0.03), logs, ("section_stiffness", "joint_friction"))
    whole = calibrate(free, logs, seed=3, evaluations=30)
    state = tmp_path / "state"

    def stop(done: int, total: int, cost: float) -> None:
        if done >= 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        calibrate(free, logs, seed=3, evaluations=30, state_file=state, on_progress=stop)
    seen = []
    resumed = calibrate(
        free, logs, seed=3, evaluations=30, state_file=state, on_progress=lambda done, *_: seen.append(done)
    )
    assert resumed.preset == whole.preset
    assert seen[0] > 12
    other = calibrate(free, logs, seed=4, evaluations=30, state_file=state)  # of another seed: from the start
    assert other.evaluations == whole.evaluations or other.preset != whole.preset


def test_parameter_that_the_logs_do_not_feel_is_named():
    logs = loops(0.0)  # a straight sheath: the coefficient of friction has nothing to act on
    free = free_parameters(start_of(sheath_bend=0.0), logs, ("section_stiffness", "sheath_friction"))
    known = uncertainty(calibrate(free, logs, seed=0, evaluations=24), free)
    assert any(warning.startswith("sheath_friction: the logs do not depend") for warning in known.warnings)
    assert not any("section_stiffness" in warning for warning in known.warnings)
    assert np.isinf(known.deviation["sheath_friction"])


def test_scale_of_forces_is_not_searched_without_load_cells():
    episode = recorded()
    blind = Episode(**(vars(episode) | {"wire_tension": np.empty((len(episode.time), 2, 0))}))
    loop = measured_loop(blind, "blind", SAMPLE_TIME)
    names = free_parameters(TRUTH, [loop]).names
    assert "section_stiffness" not in names
    assert "pretension" in names
    assert set(names) < set(DEFAULT)
    assert "section_stiffness" in free_parameters(TRUTH, loops(0.0, 1.0)).names


def test_numbers_of_the_search_and_presets_are_the_same_thing():
    free = free_parameters(TRUTH.replace(initial_bend=-0.1), loops(0.0, 1.0))
    again = free.encode(free.decode(free.start))
    np.testing.assert_allclose(again, free.start, atol=1e-12)
    assert (free.lower < free.start).all()
    assert (free.start < free.upper).all()
    outside = free.decode(free.upper + 1)
    np.testing.assert_allclose(free.encode(outside), free.upper, atol=1e-9)


def test_grid_keeps_the_loop_and_a_phase_gets_a_pace():
    episode = recorded()
    slow = measured_loop(episode, "slow", SAMPLE_TIME, pace=0.5)
    assert len(slow.pull) == pytest.approx(2 * len(episode.time), abs=2)
    np.testing.assert_allclose(slow.pull[::2][:50], episode.pull[:50], atol=1e-9)
    phased = Episode(**(vars(episode) | {"metadata": {"seconds_per_cycle": 4.0}}))
    assert len(measured_loop(phased, "phases", SAMPLE_TIME).pull) == len(slow.pull)
    half = measured_loop(episode, "half", SAMPLE_TIME, fraction=0.5)
    assert half.fitted.sum() == pytest.approx(len(half.pull) / 2, abs=1)
    assert half.fitted[0]
    assert not half.fitted[-1]


@pytest.mark.parametrize(
    ("pull", "rule"),
    [
        (np.zeros(100), "nothing to calibrate on"),
        (np.linspace(0, 3e-3, 100), "never reverses"),
        (np.linspace(3e-3, -3e-3, 100), "never reverses"),
    ],
)
def test_log_without_a_loop_is_refused(pull, rule):
    episode = recorded()
    log = {name: getattr(episode, name)[:100] for name in ("time", "bend", "measured_bend", "joint_angle")}
    log |= {"wire_tension": episode.wire_tension[:100], "sheath_friction": episode.sheath_friction[:100]}
    with pytest.raises(ValueError, match=f"a log: .*{rule}") as refused:
        measured_loop(Episode(pull=pull, **log), "a log", SAMPLE_TIME)
    assert "\n" not in str(refused.value)


def test_log_that_one_plane_in_a_sheath_at_rest_cannot_follow_is_refused():
    episode = recorded()
    count = len(episode.time)
    for changes, rule in (
        ({"sheath_bend": np.linspace(0, 1, count)}, "the sheath's bend changes"),
        ({"lateral_pull": np.linspace(0, 1e-3, count)}, "wires c and d are pulled too"),
        ({"measured_bend": -episode.measured_bend}, "import it with `reverse_angle`"),
        ({"wire_tension": np.full((count, 2, 1), 5.0)}, "the tensions do not change"),
    ):
        with pytest.raises(ValueError, match=f"odd: .*{rule}"):
            measured_loop(dataclasses.replace(episode, **changes), "odd", SAMPLE_TIME)
    with pytest.raises(ValueError, match=r"samples of 0\.05 s to fit: needs at least 10"):
        measured_loop(episode, "odd", SAMPLE_TIME, fraction=0.01)
    with pytest.raises(ValueError, match="sample time 0 s: must be positive"):
        measured_loop(episode, "odd", 0.0)


@pytest.mark.parametrize(
    ("names", "rule"),
    [
        (("stiffness",), "unknown preset parameter 'stiffness'"),
        (("vertebrae",), "cannot be fitted"),
        (("time_step",), "cannot be fitted"),
        (("gravity_z",), "no scale"),
        (("pretension", "pretension"), "named twice"),
        (("friction_wear",), "is 0 in the preset"),
    ],
)
def test_parameter_that_cannot_be_fitted_is_refused(names, rule):
    with pytest.raises(ValueError, match=rule):
        free_parameters(TRUTH, loops(0.0), names)


@given(a=st.floats(0.2, 3), b=st.floats(2, 40), c=st.floats(0, 20), start=st.floats(-20, 20))
def test_model_nearest_to_its_own_records_is_itself(a, b, c, start):
    pull = 3 + np.sin(np.linspace(0, 4 * np.pi, 120)) * np.linspace(1, 0.5, 120)
    found, rmse = best_coleman_hodgdon([(pull, ColemanHodgdon(a, b, c).response(pull, start))])
    np.testing.assert_allclose(found, [a, b, c], rtol=2e-3, atol=2e-2)
    assert rmse < 1e-2


def test_preset_is_matched_to_given_coleman_hodgdon_parameters():
    commands = [3e-3 + 1e-3 * np.sin(2 * np.pi * np.arange(0, 8, 0.02) / 4.0)]
    told = []
    wanted = TRUTH.replace(section_stiffness=0.03, sheath_friction_floor=0.7)
    episode = simulate(wanted, commands[0], 0.02)
    target, _ = best_coleman_hodgdon([(episode.pull_mm[::5], episode.bend_deg[::5])])
    free = FreeParameters(TRUTH, ("section_stiffness", "sheath_friction_floor", "pretension"))
    preset = match(free, target, commands, on_iteration=lambda *news: told.append(news))
    reached = simulate(preset, commands[0], 0.02)
    found, _ = best_coleman_hodgdon([(reached.pull_mm[::5], reached.bend_deg[::5])])
    before = np.abs(np.log(told[0][1] / target)).max()
    assert np.abs(np.log(found / target)).max() < min(0.01, before / 5)


def test_commands_of_the_match_are_those_of_generate(tmp_path):
    recipe = Recipe(TRUTH, ((2.0, 4.0),), seconds=3.0, seeds=(7,))
    for number, pull in enumerate(training_commands((2e-3, 4e-3), 2, 3.0, 7)):
        assert np.array_equal(make_episode(recipe, EpisodeKey(7, number)).pull, pull)


def test_missing_samples_are_not_fitted():
    time = np.arange(0, 20, 0.05)
    pull = 2e-3 * np.sin(2 * np.pi * time / 10)
    bend = 300 * pull + 0.05 * np.sign(np.cos(2 * np.pi * time / 10))
    seen = bend.copy()
    seen[100:140] = np.nan
    holed = Episode(
        time=time,
        pull=pull,
        bend=bend,
        measured_bend=seen,
        joint_angle=np.empty((len(time), 0)),
        wire_tension=np.empty((len(time), 2, 0)),
        sheath_friction=np.empty((len(time), 2, 0)),
    )
    loop = measured_loop(holed, "holed", 0.05)
    assert not loop.fitted[101:139].any()
    assert loop.fitted[:100].all()
    assert np.isfinite(loop.bend).all()
    nearly = dataclasses.replace(holed, measured_bend=np.where(np.arange(len(time)) < 9, bend, np.nan))
    with pytest.raises(ValueError, match=r"holed: 9 measured samples to fit: needs at least 10"):
        measured_loop(nearly, "holed", 0.05)
