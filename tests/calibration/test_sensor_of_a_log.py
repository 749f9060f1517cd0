"""Zero, lag and noise of a log's sensor: separated from the endoscope, and applied to what is predicted."""

import dataclasses

import numpy as np
import pytest
from calibrating import SAMPLE_TIME, TRUTH, recorded, start_of

from twin.calibration import calibrate, free_parameters, measured_loop, uncertainty
from twin.calibration.files import with_sensor, write_fit
from twin.calibration.objective import residuals
from twin.preset import load_preset
from twin.preset.sensor import SensorModel
from twin.signals.sensor import measure

SENSOR = SensorModel(variance_deg2=0.04, zero_deg=2.0, lag_s=0.06)
PROMPT = dataclasses.replace(SENSOR, lag_s=0.0)


def log_of(preset=TRUTH, sensor=SENSOR, seed=0, cycles=2.3, tension=False):
    """A log of the sensor, as a laboratory has it."""
    episode = recorded(preset, cycles=cycles)
    seen = preset.replace(**sensor.parameters())
    read = measure(seen, episode.time, episode.bend, np.random.default_rng(seed))
    if sensor.lag_s:  # of any lag; the simulated sensor reports whole samples
        read = np.interp(episode.time - sensor.lag_s, episode.time, episode.bend)
        read += np.random.default_rng(seed).normal(np.radians(sensor.zero_deg), seen.sensor_noise, len(read))
    wires = episode.wire_tension if tension else np.empty((len(read), 4, 0))
    facts = episode.metadata | {"source": "measured"}
    return dataclasses.replace(episode, measured_bend=read, wire_tension=wires, metadata=facts)


def loop_of(*given, **options):
    return measured_loop(log_of(*given, **options), "a log", SAMPLE_TIME)


def test_the_truth_with_its_sensor_costs_nothing():
    exact = dataclasses.replace(SENSOR, variance_deg2=0.0)
    off = residuals([TRUTH.replace(**exact.parameters())], [loop_of(sensor=exact)], weight=0.1)[0]
    np.testing.assert_allclose(off, 0, atol=1e-6)
    late = residuals([TRUTH.replace(sensor_latency=0.0)], [loop_of(sensor=exact)], weight=0.1)[0]
    assert float(late @ late) > 1


def test_zero_lag_and_noise_come_back_and_are_applied_to_another_log(tmp_path):
    loops, other = [loop_of()], loop_of(seed=1, cycles=1.6).only_predicted()
    free = free_parameters(start_of(), loops, ("wire_offset", "sensor_latency", "servo_gain", "initial_bend"))
    fit = calibrate([free], loops, seed=0, starts=2)
    assert set(fit.free.names) == {"wire_offset", "sensor_latency"}  # the others are not needed
    values = write_fit(tmp_path / "x.yaml", fit, loops, [other], 0)
    preset = load_preset(tmp_path / "x.yaml")
    found = SensorModel.of(preset)
    assert found.zero_deg == pytest.approx(2.0, abs=0.1)
    assert found.lag_s == pytest.approx(0.06, abs=0.005)
    assert 0 < found.zero_deviation_deg < 1
    assert preset.servo_gain == 0
    assert values["sensor"]["zero_deg"] == pytest.approx(found.zero_deg, abs=1e-3)
    fitted, predicted = values["logs"]
    assert fitted["offset_deg"] == pytest.approx(2.0, abs=0.1)
    assert predicted["held_out_rmse_deg"] < 0.3  # with an offset of 2 deg


def test_an_initial_bend_that_logs_show_is_no_offset():
    """Of a section that stiffens, one that is bent at rest is stiffer to one side."""
    stiffening = {"section_stiffening": 0.5}
    loops = [loop_of(TRUTH.replace(initial_bend=0.3, **stiffening), PROMPT)]
    free = free_parameters(start_of(**stiffening), loops, ("wire_offset", "initial_bend"))
    fit = calibrate([free], loops, seed=0, starts=2)
    assert fit.preset.initial_bend == pytest.approx(0.3, abs=0.03)


@pytest.mark.parametrize(
    ("tension", "stated", "expected"),
    [
        (False, 0.0, {"sensor_latency"}),
        (False, 0.05, {"command_delay"}),
        (True, 0.0, {"sensor_latency", "command_delay"}),
    ],
)
def test_load_cells_separate_the_lag_of_the_sensor_from_that_of_the_drive(tension, stated, expected):
    loops = [loop_of(tension=tension)]
    free = free_parameters(start_of(sensor_latency=stated), loops)
    assert set(free.names) & {"sensor_latency", "command_delay"} == expected


def test_what_is_not_fitted_widens_what_depends_on_it():
    """Without load cells all forces are known relative to the stiffness of the section, which is fixed."""
    loops = [loop_of(sensor=PROMPT)]
    free = free_parameters(start_of(), loops, ("pretension",))
    fit = calibrate([free], loops, seed=0, starts=1)
    known = uncertainty(fit)
    assert "section_stiffness" in fit.fixed
    alone, value = known.deviation["pretension"], fit.preset.pretension
    assert alone < 0.05 * value < 0.1 * value < known.total["pretension"] < 0.5 * value
    (condition,) = known.conditions
    assert condition.startswith("with ")
    assert "fixed at" in condition


def test_a_zero_that_the_logs_do_not_determine_is_no_reason_to_lose_a_fit():
    loops = [loop_of(sensor=PROMPT)]
    fit = calibrate([free_parameters(start_of(), loops, ("pretension",))], loops, seed=0, starts=1)
    blind = dataclasses.replace(uncertainty(fit), zero_deviation=70.0)
    assert with_sensor(fit, loops, blind).sensor_zero_deviation == np.pi
