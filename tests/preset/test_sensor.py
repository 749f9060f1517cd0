"""The sensor of a preset: its section in files, and the correction of its readings."""

import dataclasses

import numpy as np
import pytest

from twin.errors import InputError
from twin.preset import load_preset
from twin.preset.sensor import SensorModel
from twin.signals.sensor import measure

SENSOR = SensorModel(0.36, 2.0, 0.2, 1.1, 0.06, 30.0)


def test_the_section_of_a_file_is_the_sensor_of_the_preset(tmp_path):
    path = tmp_path / "bench.yaml"
    lines = [f"  {name}: {value}" for name, value in SENSOR.to_dict().items()]
    path.write_text("\n".join(["wire_offset: 1.2e-3", "sensor:", *lines]))
    preset = load_preset(path)
    assert preset.wire_offset == 1.2e-3
    assert preset.sensor_zero == pytest.approx(np.radians(2.0))
    assert SensorModel.of(preset).to_dict() == pytest.approx(SENSOR.to_dict())


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("sensor:\n  zero: 2", "unknown sensor parameter 'zero' (did you mean 'zero_deg'?)"),
        ("sensor:\n  lag_s: -1", "sensor lag_s = -1: must be from 0 to 10"),
        ("sensor: 3", "sensor = 3: must be"),
        ("sensor_zero: 0.1\nsensor:\n  lag_s: 0.1", "sensor and sensor_zero: choose one"),
    ],
)
def test_a_wrong_section_is_named(tmp_path, text, rule):
    path = tmp_path / "bench.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        load_preset(path)
    assert rule in str(error.value)


def test_corrected_readings_are_the_angle():
    time = np.arange(0, 10, 0.01)
    bend = np.radians(30 * np.sin(time))
    preset = load_preset("ureteroscope").replace(**SENSOR.parameters() | {"sensor_noise": 0.0})
    read = np.degrees(measure(preset.replace(sensor_period=0.0), time, bend, np.random.default_rng(0)))
    assert abs(read - np.degrees(bend)).max() > 3
    angle = SENSOR.angles_deg(time, read)
    known = np.isfinite(angle)
    assert known.sum() == len(time) - 6
    np.testing.assert_allclose(angle[known], np.degrees(bend)[known], atol=1e-9)


def test_what_is_given_replaces_what_is_known():
    assert SENSOR.replace(zero_deg=0.0, lag_s=None) == dataclasses.replace(SENSOR, zero_deg=0.0)
