"""Training of RAM (twins) end to end at small size: what it learns from, what it writes, what it refuses."""

import dataclasses
import re
import subprocess
import sys

import briefly
import numpy as np
import onnx
import pytest
import torch
from exported import filtered_by_both
from repository import REPOSITORY
from scipy import stats
from small_twins import (
    TINY,
    generator,
    shorter,
    small_members,
    small_records,
    small_source,
    small_step,
    still_members,
    twins,
)

import rl.on_twins
import rl.twins.run
from rl.on_twins import train_ram_twins
from rl.twins.graph import StepGraph, export_twins
from rl.twins.learning import learn_interval
from rl.twins.members import choose_members
from rl.twins.noises import FAMILIES, LINEAR, count_noise_models, draw_noises
from rl.twins.records import SAMPLE_TIME
from twin.estimation.estimator import Sensor
from twin.estimation.learned.ram_twins import STATE
from twin.estimation.learned.step import ALL_PARTS, FILTER_ALONE
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.load import load_estimator
from twin.reduced import simulate
from twin.reduced.members import members_to_dict


@pytest.fixture(scope="module", autouse=True)
def few_candidates():
    """Members are chosen from few endoscopes."""
    with pytest.MonkeyPatch.context() as patch:
        briefly.choose_members(patch)
        yield


@pytest.fixture(scope="module")
def trained(tmp_path_factory, few_candidates):
    folder = tmp_path_factory.mktemp("ram_twins")
    reported = []
    path = train_ram_twins(*twins(), TINY, folder, lambda *of: reported.append(of))
    return path, reported


def test_the_graph_that_is_deployed_is_the_step_that_was_trained(tmp_path):
    """From a state of zeros on, for any number of filters, where a measurement is missing too."""
    step = small_step(loud=2.0)
    export_twins(step, TINY.members, {"agent": "ram-twins"}, tmp_path / "policy.onnx")
    file, graph = read_trained_file(tmp_path / "policy.onnx"), StepGraph(step)
    names = ("members_deg", "way_mm", *STATE)
    for count in (1, 4):
        drawn = small_source().draw(count, 20, generator(count))
        for found, wanted in filtered_by_both(graph, file, names, drawn, 20, lambda k: k % 5 == 2):
            np.testing.assert_allclose(found, wanted, rtol=2e-3, atol=2e-3)


def test_members_and_estimated_twins_are_those_of_the_reduced_twin():
    pull_mm, members_deg, truth_deg = small_records()
    record = simulate(small_members().presets[0], pull_mm[2].astype(float) * 1e-3, SAMPLE_TIME)
    np.testing.assert_allclose(record.truth_deg, members_deg[2, 0], atol=2e-3)
    assert np.abs(pull_mm).max() <= 4
    assert (np.ptp(truth_deg, axis=1) > 0).any(axis=1).all()


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_a_noise_has_the_moments_that_it_tells(family):
    """Student's t has no fourth moment at few degrees of freedom: its median tells its scale instead."""
    noise = draw_noises([family], 20, 40_000, generator(2))
    error = 6 * np.sqrt(noise.variance / 40_000)
    assert (np.abs(noise.noise_deg.mean(axis=1) - noise.mean_deg) < error).all()
    if family != "student-t":
        np.testing.assert_allclose(noise.noise_deg.var(axis=1), noise.variance, rtol=0.1)
    assert noise.linear.all() == (family in LINEAR)
    assert set(noise.noise_model) <= set(range(count_noise_models([family])))
    assert (noise.family == 0).all()


def test_the_interval_holds_the_truth_as_often_as_it_says():
    step, source = small_step(), small_source(["gaussian", "laplace"])
    learn_interval(step, source, shorter(interval_updates=300, interval_sequences=512))
    from rl.twins.filter_step import ALL
    from rl.twins.learning import filter_sequences

    drawn = source.draw(256, 40, generator(11))
    with torch.no_grad():
        held = [
            (output.bend_deg - truth).abs() <= output.half_width_deg
            for (output, _), truth in zip(filter_sequences(step, drawn, ALL), drawn.truth_deg, strict=True)
        ]
    assert 0.92 < float(torch.stack(held).float().mean()) < 0.98


def test_a_training_writes_what_it_was_and_a_finished_one_stays(trained):
    path, reported = trained
    description = read_trained_file(path).description
    assert description["training"]["seed"] == TINY.seed
    assert description["preset"]["name"] == "ureteroscope"
    chosen = choose_members(*twins(), TINY.members, TINY.seed, moving=TINY.moving, stroke_mm=TINY.stroke_mm)
    assert description["members"] == members_to_dict(chosen)
    assert [done for done, _, _ in reported] == sorted(done for done, _, _ in reported)
    assert reported[-1][:2] == (1000, 1000)
    assert np.isfinite(reported[-1][2])
    before = path.stat().st_mtime_ns
    train_ram_twins(*twins(), TINY, path.parent)
    assert path.stat().st_mtime_ns == before
    with pytest.raises(ValueError, match="another configuration"):
        train_ram_twins(*twins(), shorter(seed=2), path.parent)


def test_intervals_of_gaussian_errors_are_those_of_the_normal_law():
    """The first width, before anything is learned of it, is that of a normal noise_model."""
    step = small_step()
    with torch.no_grad():
        assert float(step.widen(torch.zeros(1, step.seen))) == pytest.approx(stats.norm.ppf(0.975), abs=1e-3)


@pytest.mark.parametrize("parts", [ALL_PARTS, FILTER_ALONE])
def test_a_stream_that_restarts_goes_on_from_the_angle_that_it_is_given(tmp_path, parts):
    """Whatever is heard: d of every filter takes what the estimate is off by."""
    description = {"agent": "ram-twins", "members": members_to_dict(small_members())}
    export_twins(small_step(), TINY.members, description, tmp_path / "policy.onnx")
    estimator = dataclasses.replace(load_estimator(tmp_path / "policy.onnx"), parts=parts).with_sensor(
        Sensor(1.0)
    )
    pull, unseen = np.array([0.5, 0.5]), np.full(2, np.nan)
    state = estimator.start(pull, np.zeros(2))
    for measured in (3.0, 4.0, 3.5):
        state = estimator.step(state, pull, pull, np.full(2, measured))
    still = estimator.step(state, pull, pull, unseen)
    resumed = estimator.resume(state, pull, state.bend_deg + np.array([0.0, 15.0]))
    after = estimator.step(resumed, pull, pull, unseen)
    np.testing.assert_allclose(after.bend_deg - still.bend_deg, [0.0, 15.0], atol=0.05)


def test_the_document_runs_the_file_in_plain_onnx_runtime(trained, tmp_path):
    """And comes to what the estimator says of the same samples."""
    (code,) = re.findall(r"```python\n(.*?)```", (REPOSITORY / "docs/ram_twins.md").read_text(), re.DOTALL)
    (tmp_path / "runs/ram_twins").mkdir(parents=True)
    (tmp_path / "runs/ram_twins/policy.onnx").write_bytes(trained[0].read_bytes())
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr[-1000:]
    estimator = load_estimator(trained[0]).with_sensor(Sensor(1.0))
    pull, measurement = np.array([0.0, 0.1, 0.2, 0.3]), np.array([0.0, 2.9, np.nan, 5.8])
    bend, half_width = estimator.estimate_with_interval(pull, measurement, 0.0)
    said = [
        f"{angle:.2f} deg, 95 % within {half:.2f} deg"
        for angle, half in zip(bend[0, 1:], half_width[0, 1:], strict=True)
    ]
    assert done.stdout.splitlines() == said


class Stopped(Exception):
    """The user's Ctrl-C."""


@pytest.mark.slow
def test_a_training_that_was_stopped_goes_on_to_the_same_numbers(tmp_path):
    """Stopped after its first checkpoint; the whole one is never stopped."""
    settings = shorter(updates=12, episode=40, window=20)
    weights = {}
    for name in ("whole", "stopped"):
        folder = tmp_path / name

        def stop(done, total, error, folder=folder):
            if folder.name == "stopped" and (folder / "checkpoint.state").exists():
                raise Stopped

        if name == "stopped":
            with pytest.raises(Stopped):
                train_ram_twins(*twins(), settings, folder, stop)
            assert (folder / "checkpoint.state").exists()
            assert not (folder / "policy.onnx").exists()
        path = train_ram_twins(*twins(), settings, folder)
        assert not (folder / "checkpoint.state").exists()
        graph = onnx.load(path).graph
        weights[name] = {part.name: onnx.numpy_helper.to_array(part) for part in graph.initializer}
        weights[name]["curve"] = (folder / "progress.csv").read_text()
    assert weights["whole"].keys() == weights["stopped"].keys()
    for name, values in weights["whole"].items():
        np.testing.assert_array_equal(values, weights["stopped"][name], err_msg=name)


def test_a_foreign_checkpoint_is_left_alone(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "checkpoint.state").write_text("mine")
    with pytest.raises(ValueError, match=r"checkpoint\.state"):
        train_ram_twins(*twins(), TINY, folder)
    assert (folder / "checkpoint.state").read_text() == "mine"


def test_the_same_seed_trains_the_same_step(trained, tmp_path):
    """File by file the same numbers, so that a published figure can be repeated."""
    again = train_ram_twins(*twins(), TINY, tmp_path / "again")
    drawn = small_source().draw(3, 25, generator(4))
    pull = np.cumsum(drawn.inputs[1].numpy(), axis=0).T.astype(float)
    estimates = [
        load_estimator(path).estimate(pull, drawn.measurement_deg.numpy().T, 0.0)
        for path in (trained[0], again)
    ]
    np.testing.assert_allclose(*estimates, atol=1e-4)


@pytest.mark.slow
def test_a_checkpoint_of_other_members_is_not_taken_up(tmp_path, monkeypatch):
    """Its weights learned on other twins; members are computed, and may differ with the libraries."""
    settings = shorter(updates=4)

    def simulate_records(preset, ranges, members, **named):
        pull_mm, members_deg, truth_deg = small_records()
        still = members is still_members()
        return pull_mm, members_deg[:, ::-1] if still else members_deg, truth_deg

    monkeypatch.setattr(rl.twins.run, "simulate_records", simulate_records)

    def stop(done, total, error):
        if (tmp_path / "stopped" / "checkpoint.state").exists():
            raise Stopped

    def choose(members):
        monkeypatch.setattr(rl.on_twins, "choose_members", lambda *given, **named: members)

    choose(still_members())
    with pytest.raises(Stopped):
        train_ram_twins(*twins(), settings, tmp_path / "stopped", stop)
    choose(small_members())
    learned = []
    for name in ("stopped", "new"):
        graph = onnx.load(train_ram_twins(*twins(), settings, tmp_path / name)).graph
        learned.append({part.name: onnx.numpy_helper.to_array(part) for part in graph.initializer})
    for name, values in learned[1].items():
        np.testing.assert_array_equal(learned[0][name], values, err_msg=name)


def test_a_measurement_far_from_all_twins_counts_as_one_half_a_turn_away(trained):
    estimator = load_estimator(trained[0]).with_sensor(Sensor(1.0))
    state = estimator.start(np.zeros(1), np.zeros(1))
    highest = estimator.members.step(state.following, np.array([0.1])).of_filters().max()
    stepped = [
        estimator.step(state, np.array([0.1]), np.zeros(1), np.array([angle])).bend_deg[0]
        for angle in (700.0, highest + 180.0, highest + 150.0)
    ]
    assert stepped[0] == stepped[1] != stepped[2]
    single = estimator.single()
    state = single.start(0.0, 0.0)
    ends = [single.bend_deg(single.step(state, 0.1, 0.0, angle)) for angle in (700.0, highest + 180.0)]
    assert ends[0] == ends[1] == stepped[0]
