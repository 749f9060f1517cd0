"""Commands on a live stream: within their limits whatever comes, and none where none can be made."""

import io
import json
import math

import numpy as np
import pytest
from gated import export_small

from twin.control.compensator import prepare_commands
from twin.control.trial import Plant
from twin.errors import InputError
from twin.live import load_runtime
from twin.live.lines import answers
from twin.preset.sensor import SensorModel

T = 0.02


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    return export_small(tmp_path_factory.mktemp("live") / "policy.onnx")


def prepared(policy, **options):
    calibrated = SensorModel(zero_deviation_deg=0.0)
    runtime = load_runtime(policy, sample_time=T, noise_variance=1.0, sensor=calibrated, start="rest")
    return runtime, prepare_commands(policy, runtime, (-2.0, 2.0), 5.0, **options)


def answered(policy, samples):
    runtime, commands = prepared(policy)
    lines = "".join(json.dumps(sample) + "\n" for sample in samples)
    return [json.loads(answer.text) for answer in answers(runtime, io.BytesIO(lines.encode()), commands)]


def test_a_motor_driver_and_a_sensor_close_the_loop(policy):
    """The plant is one of the members, so that what is left is what the sensor's noise leaves."""
    runtime, commands = prepared(policy)
    plant = Plant(runtime.advanced.estimator.twins.presets[0].replace(servo_speed=5e-3), T, "reduced")
    bend, pull, errors = plant.start(0.0), 0.0, []
    rng = np.random.default_rng(1)
    for k in range(600):
        wanted = 5 * math.sin(2 * math.pi * (k + 1) * T / 8)
        runtime.push(k * T, pull, bend + 0.1 * rng.standard_normal())
        pull = commands.after(pull, wanted)
        bend = plant.step(pull)
        errors.append(bend - wanted)
    assert np.sqrt(np.mean(np.square(errors[100:]))) < 1.0
    assert not commands.falls_back


def test_every_command_is_within_stroke_and_speed_whatever_comes(policy):
    rng = np.random.default_rng(0)
    samples = []
    for k in range(300):
        sample = {"time_s": k * T, "pull_mm": 0.0 if k == 0 else None}
        sample["measurement_deg"] = [None, 0.0, 500.0, float(rng.normal())][k % 4]
        sample["reference_deg"] = float(rng.choice([-300.0, 0.0, 40.0, 1e6]))
        samples.append(sample)
    commands = [answer["command_mm"] for answer in answered(policy, samples)]
    assert np.abs(commands).max() <= 2.0
    assert np.abs(np.diff(commands)).max() <= 5.0 * T * (1 + 1e-9)
    assert np.ptp(commands) > 0.5


def test_no_command_before_a_pull_and_a_reference(policy):
    given = answered(
        policy,
        [
            {"time_s": 0.0, "reference_deg": 1.0},
            {"time_s": 0.02, "pull_mm": 0.0},
            {"time_s": 0.04, "pull_mm": 0.0, "reference_deg": 2.0},
        ],
    )
    assert given[0]["command_mm"] is None
    assert all(answer["command_mm"] is not None for answer in given[1:])
    (alone,) = answered(policy, [{"time_s": 0.0, "pull_mm": 0.0}])
    assert alone["command_mm"] is None


def test_a_jump_that_is_known_ahead_is_answered_ahead(policy):
    """With the angles that come, the command leaves before the jump; without them, with it."""
    wanted = [3.0] * 150 + [-3.0] * 60
    seen = 3.0 + 0.1 * np.random.default_rng(2).standard_normal(len(wanted))
    samples = [
        {"time_s": k * T, "measurement_deg": float(seen[k]), "reference_deg": of}
        for k, of in enumerate(wanted)
    ]
    samples[0]["pull_mm"] = 0.3
    ahead = [of | {"reference_preview_deg": wanted[k + 1 : k + 46]} for k, of in enumerate(samples)]
    late, early = ([answer["command_mm"] for answer in answered(policy, given)] for given in (samples, ahead))
    assert early[:104] == pytest.approx(late[:104], abs=1e-9)
    assert early[149] < late[149] - 0.1
    assert np.abs(np.diff(early)).max() <= 5.0 * T * (1 + 1e-9)


def test_a_late_sample_is_answered_by_the_latest_command(policy):
    samples = [{"time_s": k * T, "pull_mm": 0.0, "reference_deg": 8.0} for k in range(5)]
    *_, before, late = answered(policy, [*samples, samples[1] | {"reference_deg": -8.0}])
    assert "LATE" in late["health"]["sample"]
    assert late["command_mm"] == before["command_mm"]


def test_a_stroke_beyond_the_training_is_refused(policy):
    with pytest.raises(InputError, match="the pulls that the file was trained for"):
        prepare_commands(policy, load_runtime(policy), (-50.0, 50.0), 5.0)
