"""The policy of PPO as a controller: it commands what it did in its environment, and refuses another loop."""

import dataclasses
import math

import numpy as np
import pytest
from controlled import knowledge
from small_tracking import write_tiny

from rl.tracking import TrackingEnvironment
from twin.control.comparison import specs_of
from twin.control.conditions import ControlSettings
from twin.control.controller import Sensed
from twin.control.controllers.ppo import TrackingLaw, load_tracking_policy
from twin.control.trial import ControlCase, run_trial
from twin.errors import InputError
from twin.preset import load_preset, load_ranges

T = 0.02


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A policy of a few samples: it acts on all that it sees, if not well."""
    return write_tiny(tmp_path_factory.mktemp("tracking") / "ppo.onnx")


def known_of(environment, path):
    return knowledge(
        preset=environment.nominal,
        stroke_mm=environment.stroke,
        limits=environment.limits,
        sample_time=T,
        tracking_policy=path,
    )


@pytest.mark.parametrize("stroke", [(-1.0, 1.0), (2.0, 4.0)])
def test_it_commands_what_the_policy_did_in_its_environment(trained, stroke):
    preset = load_preset("ureteroscope").replace(sensor_latency=0.06)
    environment = TrackingEnvironment(preset, randomized=True, stroke_mm=stroke, physics="reduced", seconds=4)
    environment.stroke = stroke
    policy = load_tracking_policy(trained)
    observation, info = environment.reset(seed=5)
    infos, truncated = [info], False
    while not truncated:
        action = np.array([policy(observation)], np.float32)
        observation, _, _, truncated, info = environment.step(action)
        infos.append(info)
    state = environment.save_state()
    case = ControlCase(state.preset, state.reference_deg, state.noise_deg, physics="reduced")
    trial = run_trial("ppo", known_of(environment, trained), case)
    pulls = np.array([info["pull_mm"] for info in infos])
    np.testing.assert_array_equal(trial.pull_mm, pulls)
    np.testing.assert_array_equal(trial.truth_deg, [info["bend_deg"] for info in infos])
    by_line = [environment.line.pull_mm(wanted) for wanted in trial.reference_deg]
    assert np.abs(pulls - by_line).max() > 0.01  # the policy has acted


def controller(trained, **changes):
    return TrackingLaw(knowledge(**{"sample_time": T, "tracking_policy": trained} | changes), {})


@pytest.fixture
def law(trained):
    limits = dataclasses.replace(knowledge().limits, speed_mm_s=5.0)
    return controller(trained, limits=limits)


def test_samples_without_a_measurement_are_bridged_by_the_low_passed_error(law):
    law.start(0.0, 10.0)
    for k in range(50):
        law.step(Sensed(k * T, 14.0, 10.0, 10.0))
    seen, policy = [], law._policy
    law._policy = lambda observation: seen.append(observation) or policy(observation)
    for k in range(3):
        law.step(Sensed((50 + k) * T, math.nan, 10.0, 10.0))
    law.step(Sensed(53 * T, 14.0, 10.0, 10.0))
    seen = np.array(seen)
    assert np.isfinite(seen).all()
    np.testing.assert_array_equal(seen[:3, 0], seen[:3, 1])
    assert seen[0, 1] == seen[2, 1] == pytest.approx(4.0 / 5.0, rel=0.01)
    assert seen[3, 0] == pytest.approx(4.0 / 5.0)


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"sample_time": 0.1}, r"sample time = 0\.1 s, .*with 0\.02 s and 5 mm/s: it runs with no other"),
        ({}, r"speed limit = 8 mm/s: .*was trained with 0\.02 s and 5 mm/s"),
        ({"tracking_policy": None}, "a controller on PPO on EndoTwin/Tracking-v0 needs a trained file"),
    ],
)
def test_another_loop_is_refused_in_one_line(trained, changes, rule):
    speed = 5.0 if changes else 8.0
    limits = dataclasses.replace(knowledge().limits, speed_mm_s=speed)
    with pytest.raises(InputError, match=rule) as refused:
        controller(trained, limits=limits, **changes)
    assert "\n" not in str(refused.value)


def settings_with(**files) -> ControlSettings:
    return ControlSettings(load_preset("ureteroscope"), load_ranges("ureteroscope"), **files)


def test_it_is_compared_where_its_file_is_given(trained):
    names = [spec.name for spec in specs_of(settings_with(tracking_policy=trained), ["all"])]
    assert "ppo" in names
    assert "members-inverse" not in names
    assert names.index("pid") < names.index("ppo")
    assert "ppo" not in [spec.name for spec in specs_of(settings_with(policy=trained), ["all"])]
    with pytest.raises(InputError, match=r"'ppo' runs on .*PPO.*: none is given"):
        specs_of(settings_with(policy=trained), ["ppo"])
