"""Each check refuses what it is there for, says why, and lets the sound pass."""

import json

import numpy as np
import onnx
import pytest
from briefly import tune_filters
from changed_graph import initializer, with_flipped_sign, with_initializer, without_operator
from gated import logs_on, material_of
from small_twins import twins

from rl.options import TrainingOptions
from rl.training import train_policy
from twin.estimation.active_model import ActiveModel
from twin.files.origin import Origin, origin_of
from twin.gate import run_gate
from twin.gate.checks import accuracy, bounds, faults, honesty, identity, latency, sufficiency
from twin.gate.page import gate_page
from twin.gate.table import CHECKS
from twin.hysteresis import ColemanHodgdon
from twin.preset import load_preset, load_ranges

FRICTION = (
    "joint_friction",
    "routing_friction",
    "sheath_friction",
    "sheath_friction_floor",
    "sheath_friction_growth",
)


@pytest.fixture(autouse=True)
def brief(monkeypatch):
    tune_filters(monkeypatch)


def test_an_untrained_policy_is_worth_nothing_and_misleads(untrained_twins):
    material = material_of(untrained_twins)
    check = accuracy.learning_helps(material)
    assert check.holds is False
    assert "untrained" in check.said
    assert honesty.coverage(material).holds is False


def test_an_untrained_policy_of_the_paper_is_worse_than_the_trusted_filter(paper_policy):
    check = accuracy.on_held_out_twins(material_of(paper_policy))
    assert check.holds is False
    assert "worse than AM-tuned" in check.said
    assert len(check.rows) == 6 + 3  # noises and strokes


def test_a_policy_of_another_endoscope_is_refused(untrained_twins):
    assert identity.made_for_endoscope(material_of(untrained_twins)).holds is True
    other = material_of(untrained_twins, preset=load_preset("vio_com"), ranges=load_ranges("vio_com"))
    check = identity.made_for_endoscope(other)
    assert check.holds is False
    assert "trained for 'ureteroscope'" in check.said
    assert "section_stiffness" in {row["parameter"] for row in check.rows}


def test_an_endoscope_within_the_ranges_of_the_training_is_the_same_one():
    preset, ranges = twins()
    drawn = ranges.draw(preset, np.random.default_rng(1)).replace(name="another", sensor_noise=0.01)
    assert not identity.differing_parameters(preset.to_dict(), ranges.to_dict(), drawn)
    (row,) = identity.differing_parameters(preset.to_dict(), ranges.to_dict(), drawn.replace(vertebrae=8))
    assert row["parameter"] == "vertebrae"


def test_the_exported_graph_says_what_the_network_said(untrained_twins, paper_policy):
    for path in (untrained_twins, paper_policy):
        check = identity.faithful(material_of(path))
        assert check.holds is True
        assert check.figure < 1e-6


def test_a_policy_whose_normaliser_was_removed_is_refused(paper_policy, tmp_path):
    changed = without_operator(paper_policy, tmp_path / "policy.onnx", "Log")
    check = identity.faithful(material_of(changed))
    assert check.holds is False
    assert "not the network that was trained" in check.said


@pytest.mark.parametrize(
    "name", ["policy.0", "policy.2", "policy.4", "bank.laws.prior.0", "bank.laws.prior.2"]
)
def test_a_flipped_sign_is_found_in_any_layer(loud_twins, tmp_path, name):
    weights = f"step.{name}.weight"
    largest = int(np.abs(initializer(onnx.load(loud_twins), weights)).argmax())
    changed = with_flipped_sign(loud_twins, tmp_path / "policy.onnx", weights, largest)
    assert identity.faithful(material_of(changed)).holds is False


def test_the_flipped_sign_of_the_weight_that_matters_most_is_found(paper_policy, tmp_path):
    model = onnx.load(paper_policy)
    names = [part.name for part in model.graph.initializer if "weight" in part.name]
    for name in names:
        weights = initializer(model, name)
        changed = with_flipped_sign(
            paper_policy, tmp_path / "policy.onnx", name, int(np.abs(weights).argmax())
        )
        check = identity.faithful(material_of(changed))
        assert check.holds is False
        assert "not the network that was trained" in check.said


def test_a_file_without_reference_steps_shows_nothing(untrained_twins, tmp_path):
    model = onnx.load(untrained_twins)
    told = json.loads(model.metadata_props[0].value)
    for reference, holds in ((None, None), ({}, False), ({"inputs": {}, "outputs": {}}, False), ("x", False)):
        told["reference"] = reference
        shown = {name: value for name, value in told.items() if value is not None}
        onnx.helper.set_model_props(model, {"endotwin": json.dumps(shown)})
        onnx.save(model, tmp_path / "policy.onnx")
        check = identity.faithful(material_of(tmp_path / "policy.onnx"))
        assert check.holds is holds
        assert check.passes is (holds is None)


def test_a_policy_of_five_records_fails_on_logs_outside_of_them(tmp_path):
    preset, _ = twins()
    seen = logs_on(preset, (2.0, 4.0), seconds=20.0)
    records = [(episode.pull_mm, episode.truth_deg) for episode in seen + seen[:1] + seen]
    assert len(records) == 5
    options = TrainingOptions(episodes=32, environments=16, horizon=512, seed=3)
    active_model = ActiveModel(ColemanHodgdon(1.33, 22.3, 3.4), 0.1)
    path = train_policy(records, active_model, options, tmp_path / "run")
    check = accuracy.on_logs(material_of(path, logs_on(preset, (-4.0, 0.0))))
    assert check.holds is False
    assert "on the logs it is worse than AM-tuned" in check.said


def test_a_twin_of_half_the_friction_is_no_picture_of_the_logs(untrained_twins):
    preset, ranges = twins()
    episodes = logs_on(preset, (-2.0, 3.0))
    sound = sufficiency.twin_of_logs(material_of(untrained_twins, episodes))
    assert sound.holds is True
    assert sound.figure < 0.2
    halved = preset.replace(**{name: getattr(preset, name) / 2 for name in FRICTION})
    check = sufficiency.twin_of_logs(material_of(untrained_twins, episodes, preset=halved, ranges=ranges))
    assert check.holds is False
    assert check.figure > 5
    assert "calibrate" in check.said


def test_gains_are_proven_and_tried(untrained_twins, paper_policy):
    for path in (untrained_twins, paper_policy):
        material = material_of(path)
        proven, tried = bounds.proven_bounds(material), bounds.tried_bounds(material)
        assert (proven.holds, tried.holds) == (True, True), (proven, tried)
        assert proven.rows


def test_a_policy_that_is_not_bounded_any_more_is_seen(paper_policy, tmp_path):
    model = onnx.load(paper_policy)
    name = next(part.name for part in model.graph.initializer if list(part.dims) == [2])
    onnx.save(with_initializer(model, name, np.array([3.0, 0.0])), tmp_path / "loud.onnx")
    changed = without_operator(tmp_path / "loud.onnx", tmp_path / "policy.onnx", "Clip")
    material = material_of(changed)
    assert bounds.proven_bounds(material).holds is None
    tried = bounds.tried_bounds(material)
    assert tried.holds is False
    assert "beyond its bounds" in tried.said


def test_what_stands_behind_an_interval_is_told(untrained_twins, paper_policy):
    material = material_of(untrained_twins)
    for check in (honesty.coverage(material), honesty.nees(material), honesty.nis(material)):
        assert check.figure > 0
        assert check.rows
    assert honesty.coverage(material_of(paper_policy)).holds is None


def test_faults_and_latency_are_tried_in_the_runtime(untrained_twins):
    material = material_of(untrained_twins)
    assert faults.no_nan(material).holds is True
    errors, flagged = faults.errors(material), faults.flagged(material)
    assert len(errors.rows) == 10
    assert {row["fault"]: row["flagged"] for row in flagged.rows}["no measurement"] == 1
    assert latency.latency(material).figure > 0


def test_the_verdict_has_a_reason_for_every_check_that_does_not_pass(untrained_twins, tmp_path):
    preset, _ = twins()
    shares = []
    material = material_of(untrained_twins, logs_on(preset, (-2.0, 3.0), count=1))
    verdict = run_gate(material, lambda done, total, note: shares.append(done / total))
    assert verdict.word == "no-go"
    assert [check.name for check in verdict.checks] == [spec.name for spec in CHECKS]
    assert len(verdict.reasons) == sum(not check.passes for check in verdict.checks)
    assert shares == sorted(shares)
    assert shares[-1] == 1
    text = json.dumps(verdict.to_dict(), allow_nan=False)
    assert {"name", "figure", "bar", "holds"} <= json.loads(text)["checks"][0].keys()
    origin = Origin(**origin_of("endotwin gate x", []))
    page = gate_page(verdict, origin, "gate.html").write(tmp_path / "gate.html").read_text()
    assert "made by endotwin gate" in page
    assert "What was not shown" in page
    assert "<script" not in page
    assert "endotwin gate x --out gate.html" in page
    for reason in verdict.reasons:
        assert reason.split(":")[0] in page
