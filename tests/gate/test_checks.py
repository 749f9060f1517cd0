"""Each check refuses what it is for, gives the reason, and lets the sound pass."""

import dataclasses
import html
import json
import re

import numpy as np
import onnx
import pytest
from changed_graph import initializer, with_flipped_sign, with_initializer, without_operator
from gated import logs_on, material_of
from small_twins import twins

from twin.files.origin import Origin, origin_of
from twin.gate import accuracy, identity, run_gate, stream, sufficiency
from twin.gate.page import gate_page
from twin.gate.run import CHECKS
from twin.preset import load_preset, load_ranges

FRICTION = (
    "joint_friction",
    "routing_friction",
    "sheath_friction",
    "sheath_friction_floor",
    "sheath_friction_growth",
)


def test_untrained_policy_is_worth_nothing_and_misleads(untrained):
    check = accuracy.learning_helps(untrained)
    assert check.holds is False
    assert "untrained" in check.said
    assert accuracy.coverage(untrained).holds is False
    for make in (accuracy.coverage, accuracy.nees, accuracy.nis):
        assert make(untrained).figure > 0
        assert make(untrained).rows


def test_untrained_policy_of_the_paper_is_not_better_than_the_trusted_filter(paper_policy):
    material = material_of(paper_policy)
    check = accuracy.on_held_out_twins(material)
    assert check.holds is False
    assert "not shown to be better than AM-tuned" in check.said
    assert len(check.rows) == 6 + 3  # noises and strokes
    assert accuracy.coverage(material).holds is None  # it states no interval


def test_policy_of_another_endoscope_is_refused(untrained, untrained_twins):
    assert identity.made_for_endoscope(untrained).holds is True
    other = material_of(untrained_twins, preset=load_preset("vio_com"), ranges=load_ranges("vio_com"))
    check = identity.made_for_endoscope(other)
    assert check.holds is False
    assert "trained for 'ureteroscope'" in check.said
    assert "section_stiffness" in {row["parameter"] for row in check.rows}


def test_endoscope_within_the_ranges_of_the_training_is_the_same_one():
    preset, ranges = twins()
    drawn = ranges.draw(preset, np.random.default_rng(1)).replace(name="another", sensor_noise=0.01)
    assert not identity.differing_parameters(preset.to_dict(), ranges.to_dict(), drawn)
    (row,) = identity.differing_parameters(preset.to_dict(), ranges.to_dict(), drawn.replace(vertebrae=8))
    assert row["parameter"] == "vertebrae"


def test_exported_graph_returns_what_the_network_returned(untrained, paper_policy):
    for material in (untrained, material_of(paper_policy)):
        check = identity.faithful(material)
        assert check.holds is True
        assert check.figure < 1e-6


def test_policy_whose_normaliser_was_removed_is_refused(paper_policy, tmp_path):
    changed = without_operator(paper_policy, tmp_path / "policy.onnx", "Log")
    check = identity.faithful(material_of(changed))
    assert check.holds is False
    assert "not the network that was trained" in check.said


def flipped(policy, path, weights):
    """A policy with another sign of its largest weight of a layer."""
    return with_flipped_sign(policy, path, weights, np.abs(initializer(onnx.load(policy), weights)).argmax())


def test_flipped_sign_is_found_in_any_layer(untrained_twins, paper_policy, tmp_path):
    layers = [(untrained_twins, "step.filter_bank.noise_models.prior.2.weight")]
    graph = onnx.load(paper_policy).graph
    layers += [(paper_policy, part.name) for part in graph.initializer if "weight" in part.name]
    for policy, weights in layers:
        changed = flipped(policy, tmp_path / "policy.onnx", weights)
        assert identity.faithful(material_of(changed)).holds is False, weights


def test_file_without_reference_steps_shows_nothing(untrained_twins, tmp_path):
    model = onnx.load(untrained_twins)
    description = json.loads(model.metadata_props[0].value)
    for reference, holds in ((None, None), ({}, False), ({"inputs": {}, "outputs": {}}, False), ("x", False)):
        description["reference"] = reference
        shown = {name: value for name, value in description.items() if value is not None}
        onnx.helper.set_model_props(model, {"endotwin": json.dumps(shown)})
        onnx.save(model, tmp_path / "policy.onnx")
        check = identity.faithful(material_of(tmp_path / "policy.onnx"))
        assert check.holds is holds
        assert check.passes is (holds is None)


def test_twin_of_half_the_friction_does_not_reproduce_the_logs(untrained_twins):
    preset, ranges = twins()
    episodes = logs_on(preset, (-2.0, 3.0), count=1)
    sound = sufficiency.twin_of_logs(material_of(untrained_twins, episodes))
    assert sound.holds is True
    assert sound.figure < 0.2
    halved = preset.replace(**{name: getattr(preset, name) / 2 for name in FRICTION})
    check = sufficiency.twin_of_logs(material_of(untrained_twins, episodes, preset=halved, ranges=ranges))
    assert check.holds is False
    assert check.figure > 5
    assert "Calibrate" in check.remedy


def test_an_offset_of_the_sensor_is_named_and_corrected_for(untrained_twins):
    preset, ranges = twins()
    preset = preset.replace(sensor_zero_deviation=0.0)  # calibrated, it is said
    (episode,) = logs_on(preset, (-2.0, 3.0), count=1)
    rng = np.random.default_rng(3)
    read = episode.bend + np.radians(2.0 + 0.3 * rng.standard_normal(len(episode.bend)))
    log = dataclasses.replace(episode, measured_bend=read, metadata=episode.metadata | {"source": "measured"})
    check = sufficiency.zero_of_logs(material_of(untrained_twins, [log], preset=preset, ranges=ranges))
    assert check.holds is False
    assert check.figure == pytest.approx(2.0, abs=0.15)
    (stated,) = re.findall(r"--sensor-zero-deg (\S+)\)", check.remedy)
    assert float(stated) == pytest.approx(2.0, abs=0.15)
    known = preset.replace(sensor_zero=np.radians(2.0))
    material = material_of(untrained_twins, [log], preset=known, ranges=ranges)
    assert sufficiency.zero_of_logs(material).holds is True
    angle = material.logs[0].reference_deg
    smooth = angle - episode.truth_deg[: len(angle)]
    assert np.nanstd(smooth) < 0.2 < 0.3


def test_bounds_hold_by_construction_and_on_hostile_inputs(untrained, paper_policy):
    for material, bounded in (
        (untrained, {"total gain"}),
        (material_of(paper_policy), {"action of the policy"}),
    ):
        proven, tried = identity.proven_bounds(material), identity.tried_bounds(material)
        assert (proven.holds, tried.holds) == (True, True), (proven, tried)
        assert {row["what"] for row in proven.rows} == bounded


def test_policy_without_bounds_is_refused(paper_policy, tmp_path):
    model = onnx.load(paper_policy)
    name = next(part.name for part in model.graph.initializer if list(part.dims) == [2])
    onnx.save(with_initializer(model, name, np.array([30.0, 0.0])), tmp_path / "loud.onnx")
    changed = without_operator(tmp_path / "loud.onnx", tmp_path / "policy.onnx", "Clip")
    material = material_of(changed)
    assert identity.proven_bounds(material).holds is None
    assert identity.tried_bounds(material).holds is False


@pytest.mark.slow
def test_faults_and_latency_are_tried_in_the_runtime(untrained):
    assert stream.no_nan(untrained).holds is True
    errors, flagged = stream.errors(untrained), stream.flagged(untrained)
    assert len(errors.rows) == len(stream.FAULTS)
    assert {row["fault"]: row["flagged"] for row in flagged.rows}["no measurement"] == 1
    assert stream.latency(untrained).figure > 0


def test_verdict_has_a_reason_for_every_check_that_does_not_pass(untrained, tmp_path):
    shares = []
    verdict = run_gate(untrained, lambda done, total, note: shares.append(done / total))
    assert verdict.word == "no-go"
    assert [check.name for check in verdict.checks] == [spec.name for spec in CHECKS]
    assert len(verdict.checks) == 18
    assert len(verdict.reasons) == sum(not check.passes for check in verdict.checks)
    assert shares == sorted(shares)
    assert shares[-1] == 1
    text = json.dumps(verdict.to_dict(), allow_nan=False)
    assert {"name", "figure", "bar", "holds"} <= json.loads(text)["checks"][0].keys()
    origin = Origin(**origin_of("endotwin gate x", []))
    page = gate_page(verdict, origin, "gate.html").write(tmp_path / "gate.html").read_text()
    assert "What was not shown" in page
    assert "endotwin gate x --out gate.html" in page
    for reason in verdict.reasons:
        assert reason.split(":")[0] in page
    for check in verdict.checks:
        assert bool(check.remedy) is (check.holds is not True), check.name
        assert check.remedy in html.unescape(page)
