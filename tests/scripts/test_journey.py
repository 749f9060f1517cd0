"""From a log of a bench to an estimate: the commands of the README's section "On a device", as printed.

The bench is simulated: a camera with an offset of 2 deg and a lag of 66 ms watches an endoscope that is drawn
from the ranges of the preset. Only the training and the gate are shorter than printed.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from documented import snippets

from scripts.samples import copy_samples
from scripts.studies.make_samples import CAMERA, SEED
from twin.preset import load_preset, load_ranges
from twin.preset.sensor import SensorModel
from twin.simulation import simulate

SHORTER = (("--seed 1", "--seed 1 --episodes 300"), ("endotwin gate", "endotwin gate --quick"))
ENDOTWIN = Path(sys.executable).parent


def device_commands():
    text = Path(__file__).parents[2].joinpath("README.md").read_text()
    first = text[: text.index("## On a device")].count("\n")
    last = text[: text.index("## Make figures")].count("\n")
    return [of.text for of in snippets("README.md") if first < of.line <= last]


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """The folder after all commands, with what each has printed."""
    folder = tmp_path_factory.mktemp("bench")
    copy_samples(folder)
    said = {}
    for command in device_commands():
        for printed, shorter in SHORTER:
            command = command.replace(printed, shorter)
        path = f"PATH={ENDOTWIN}:$PATH {command}"
        done = subprocess.run(path, shell=True, cwd=folder, capture_output=True, text=True, check=False)
        said[command.split()[1]] = done.stdout + done.stderr
        if "gate" not in command:  # a policy that was trained for a minute need not pass
            assert done.returncode == 0, done.stderr[-500:]
    return folder, said


@pytest.mark.slow
def test_offset_lag_and_noise_of_the_sensor_are_found(bench):
    folder, _ = bench
    sensor = SensorModel.of(load_preset(folder / "preset.yaml"))
    assert sensor.zero_deg == pytest.approx(CAMERA.zero_deg, abs=0.3)
    assert sensor.lag_s == pytest.approx(CAMERA.lag_s, abs=0.015)
    assert sensor.variance_deg2 == pytest.approx(CAMERA.variance_deg2, rel=0.2)


@pytest.mark.slow
def test_the_gate_finds_the_twin_and_its_sensor_in_the_log(bench):
    folder, _ = bench
    checks = {of["name"]: of for of in json.loads((folder / "gate.json").read_text())["checks"]}
    assert checks["the zero of the sensor"]["holds"]
    assert checks["the twin reproduces the logs"]["holds"]


@pytest.mark.slow
def test_the_estimate_is_the_angle_and_not_what_the_camera_saw(bench):
    folder, said = bench
    readings = [json.loads(line) for line in (folder / "readings.jsonl").read_text().splitlines()]
    samples = [json.loads(line) for line in (folder / "bench.jsonl").read_text().splitlines()]
    endoscope = load_ranges("ureteroscope").draw(load_preset("ureteroscope"), np.random.default_rng(SEED))
    pull = np.array([of["pull_mm"] for of in samples])
    truth = simulate(endoscope, pull * 1e-3, sample_time=1 / CAMERA.rate_hz).truth_deg
    error = np.array([of["bend_deg"] for of in readings]) - truth
    late = round(5 * CAMERA.rate_hz)
    assert np.sqrt(np.mean(error[late:] ** 2)) < 0.6
    low, high = np.array([of["interval_deg"] for of in readings[late:]]).T
    assert np.mean((low <= truth[late:]) & (truth[late:] <= high)) > 0.8
    assert "OFFSET" not in said["run"]
