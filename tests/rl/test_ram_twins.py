"""Training of RAM (twins) end to end at small size: what it learns from, what it writes, what it refuses."""

import dataclasses
import re
import subprocess
import sys

import briefly
import numpy as np
import pytest
import torch
import yaml
from exported import filtered_by_both
from repository import REPOSITORY
from scipy import stats
from small_twins import (
    TINY,
    generator,
    shorter,
    small_members,
    small_source,
    small_step,
    twins,
)

from rl.on_twins import train_ram_twins
from rl.twins.graph import StepGraph, export_twins
from rl.twins.learning import learn_interval
from rl.twins.members import choose_members
from rl.twins.noises import FAMILIES, LINEAR, draw_noises, noise_models
from twin.estimation.estimator import Sensor
from twin.estimation.learned.ram_twins import STATE
from twin.estimation.learned.step import ALL_PARTS, FILTER_ALONE
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.load import load_estimator
from twin.reduced.members import members_to_dict
from twin.report.report import write_report


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
    step = small_step()
    export_twins(step, TINY.members, {"agent": "ram-twins"}, tmp_path / "policy.onnx")
    file, graph = read_trained_file(tmp_path / "policy.onnx"), StepGraph(step)
    names = ("members_deg", "way_mm", *STATE)
    for count in (1, 4):
        drawn = small_source().draw(count, 20, generator(count))
        for found, wanted in filtered_by_both(graph, file, names, drawn, 20, lambda k: k % 5 == 2):
            np.testing.assert_allclose(found, wanted, rtol=2e-3, atol=2e-3)


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_a_noise_has_mean_zero_and_the_variance_that_it_tells(family):
    """Student's t has no fourth moment at few degrees of freedom: its median tells its scale instead."""
    noise = draw_noises([family], 20, 40_000, generator(2))
    samples = 40_000 / (40 if family == "correlated" else 1)  # as many as are independent of each other
    error = 6 * np.sqrt(noise.variance / samples)
    assert (np.abs(noise.noise_deg.mean(axis=1)) < error).all()
    if family != "student-t":
        np.testing.assert_allclose(noise.noise_deg.var(axis=1), noise.variance, rtol=0.15)
    assert noise.linear.all() == (family in LINEAR)
    models = range(len(noise_models([family]))) if FAMILIES[family].shapes else [-1]
    assert set(noise.noise_model) <= set(models)
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


def test_the_folder_of_a_training_names_its_agent_in_its_page_and_for_the_gate(trained, tmp_path):
    path, _ = trained
    assert "<h1>ram-twins: " in write_report(path.parent, tmp_path / "report.html").read_text()
    configuration = yaml.safe_load((path.parent / "config.yaml").read_text())
    file = read_trained_file(path)
    assert configuration.items() <= {"agent": file.agent, **file.description}.items()


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
    resumed = estimator.resume(state, state, pull, state.bend_deg + np.array([0.0, 15.0]))
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
        load_estimator(path, Sensor(1.0)).estimate(pull, drawn.measurement_deg.numpy().T, 0.0)
        for path in (trained[0], again)
    ]
    np.testing.assert_allclose(*estimates, atol=1e-4)


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


def test_an_initial_estimate_counts_as_far_as_its_deviation_tells(trained):
    """A sure one is the estimate before anything is measured; one that is worth nothing is as none."""
    estimator = load_estimator(trained[0], Sensor(1.0))
    pull, unseen, first = np.array([0.5, 0.5]), np.full(2, np.nan), np.array([3.0, -4.0])

    def next_deg(deviation):
        begun = estimator.begun(from_rest=True, initial_deviation_deg=deviation)
        return begun.step(begun.start(pull, first), pull, pull, unseen).bend_deg

    np.testing.assert_allclose(next_deg(1e-3), first, atol=0.02)
    np.testing.assert_allclose(next_deg(1e6), next_deg(np.inf), atol=1e-3)
    assert np.ptp(next_deg(np.inf)) < 1e-9


def test_an_estimator_whose_sensor_nobody_stated_refuses_to_run(trained):
    with pytest.raises(ValueError, match="sensor is not known"):
        load_estimator(trained[0]).estimate(np.zeros(5), np.zeros(5), 0.0)
