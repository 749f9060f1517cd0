"""Every reader of a file that others wrote: it takes a hostile version or refuses it in one line."""

import json
import time

import numpy as np
import onnx
import pytest
import yaml
from dataset_contents import FIGURES, contents
from hostile import mutated, refusal
from hypothesis import given, settings
from hypothesis import strategies as st
from models import BOUC_WEN, COLEMAN_HODGDON
from scores import SCORE

from twin.dataset.recipe_file import load_recipe
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.learned.reference import ESTIMATE
from twin.estimation.load import load_estimator, model_of
from twin.evaluation.results import load_runs, load_tracks
from twin.evaluation.score import read_evaluation
from twin.files.dataset_json import read_contents
from twin.hysteresis import PrandtlIshlinskii, load_model, model_to_dict
from twin.preset.file import load_preset
from twin.preset.preset import Preset
from twin.preset.randomization import load_ranges
from twin.recording.facts import check_facts

PRESET = Preset("mine").to_dict() | {"ranges": {"pretension": [1.0, 6.0]}}
RECIPE = {
    "preset": Preset("mine").to_dict(),
    "ranges": {"pretension": [1.0, 6.0]},
    "seeds": [1, 2],
    "seconds": 0.5,
    "strokes_mm": [[0.0, 1.0]],
    "sheath_bends_deg": [90, [0, 90]],
    "signals": ["sine"],
    "sensor": {"variance_deg2": 0.1},
    "camera": {"pictures_per_second": 5.0, "width": 160, "height": 120},
}
MODELS = [
    model_to_dict(model) for model in (COLEMAN_HODGDON, BOUC_WEN, PrandtlIshlinskii((8.0, 4.0), (0.0, 0.5)))
]
FACTS = {
    "preset": Preset("mine").to_dict(),
    "name": "a",
    "source": "measured",
    "seed": 1,
    "episode": 2,
    "signal": "sine",
    "stroke_mm": [-1.0, 1.0],
    "sheath_bend_deg": [0.0, 90.0],
    "statistics": {"truth_deg": FIGURES},
    "pulley_radius": 0.01,
}
READERS = {
    "preset.yaml": (load_preset, PRESET),
    "ranges.yaml": (load_ranges, PRESET),
    "recipe.yaml": (load_recipe, RECIPE),
    "coleman_hodgdon.json": (load_model, MODELS[0]),
    "bouc_wen.json": (load_model, MODELS[1]),
    "prandtl_ishlinskii.json": (load_model, MODELS[2]),
    "evaluation.json": (read_evaluation, {"protocol": {"suite": "paper"}, "rows": [SCORE.to_dict()]}),
    "dataset.json": (lambda path: read_contents(path.parent), contents()),
}
HEAD = '[{"noise": "n", "level": 1.0, "methods": []}]'
DESCRIPTION = {"agent": "ram", "active_model": ActiveModel(COLEMAN_HODGDON, 0.1).to_dict()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("hostile")


@pytest.mark.parametrize("name", READERS)
def test_the_valid_file_is_taken(name, folder):
    read, valid = READERS[name]
    path = folder / name
    path.write_text(json.dumps(valid) if name.endswith("json") else yaml.safe_dump(valid))
    assert refusal(read, path) is None


@pytest.mark.parametrize("name", READERS)
@given(data=st.data())
@settings(max_examples=40)
def test_a_mutated_file_is_taken_or_refused_in_one_line(name, folder, data):
    read, valid = READERS[name]
    path = folder / name
    changed = data.draw(mutated(valid))
    path.write_text(json.dumps(changed) if name.endswith("json") else yaml.safe_dump(changed))
    begin = time.process_time()
    refusal(read, path)
    assert time.process_time() - begin < 5


@pytest.mark.parametrize("name", [*READERS, "tracks.npz", "runs.npz", "policy.onnx", "a.mcap"])
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00",
        b"\xff\xfe",
        b"[" * 200_000,
        b'{"a":' * 200_000,
        b"- " * 200_000,
        b"a: &a [*a]",
        b"\x80" * 999,
    ],
    ids=range(8),
)
def test_what_is_no_such_file_at_all_is_refused_in_one_line(name, content, folder):
    from twin.recording import read_episode

    arrays = {"tracks.npz": load_tracks, "runs.npz": load_runs}
    others = arrays | {"policy.onnx": load_estimator, "a.mcap": read_episode}
    read = others[name] if name in others else READERS[name][0]
    (folder / name).write_bytes(content)
    taken = {"recipe.yaml": (b"",)}  # a recipe may leave every key out
    assert (refusal(read, folder / name) is None) == (content in taken.get(name, ()))


@given(data=st.data())
def test_metadata_of_an_episode_is_taken_or_refused_in_one_line(data):
    changed = data.draw(mutated(FACTS))
    said = "metadata "
    try:
        check_facts(changed if isinstance(changed, dict) else {})
    except InputError as error:
        said = str(error)
    assert said.startswith("metadata ")
    assert len(said) <= 220
    assert said.isprintable()


def policy(nodes, size=1, description=DESCRIPTION) -> bytes:
    """A graph of one sample in an ONNX file, of one sum and some operators after it."""
    make, kind = onnx.helper, onnx.TensorProto.FLOAT
    graph = make.make_graph(
        [make.make_node("Add", ["measurement_deg", "w"], ["y"]), *nodes],
        "g",
        [make.make_tensor_value_info("measurement_deg", kind, ["n"])],
        [make.make_tensor_value_info(ESTIMATE, kind, ["n"])],
        [make.make_tensor("w", kind, [size], [0.0] * size)],
    )
    model = make.make_model(graph, opset_imports=[make.make_opsetid("", 20)], ir_version=10)
    make.set_model_props(model, {"endotwin": json.dumps(description)})
    return model.SerializeToString()


def node(operator: str, **attributes):
    return onnx.helper.make_node(operator, ["y"], [ESTIMATE], **attributes)


def test_a_trained_file_is_accepted(folder):
    (folder / "p.onnx").write_bytes(policy([node("Tanh")]))
    assert refusal(load_estimator, folder / "p.onnx") is None
    assert model_of(folder / "p.onnx") == COLEMAN_HODGDON


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (policy([node("Softplus")]), "has the operator Softplus, which training never writes"),
        (policy([node("Tanh", domain="evil")]), "has the operator evil Tanh"),
        (policy([node("Loop", body=onnx.helper.make_graph([], "b", [], []))]), "never writes"),
        (policy([node("Log")]), "is not finite where"),
        (policy([node("Tanh")], 3), "arrays that do not fit"),
        (policy([node("Tanh")], 9000), "array of shape"),
        (policy([node("Tanh")], description={"agent": ["ram"]}), "agent = "),
        (policy([node("Tanh")], description={"agent": "dqn"}), "unknown agent 'dqn'"),
        (policy([node("Tanh")])[:-40], "is not a trained file"),
    ],
    ids=range(9),
)
def test_a_network_that_training_never_wrote_is_refused(content, fault, folder):
    (folder / "p.onnx").write_bytes(content)
    with pytest.raises(InputError, match=fault):
        load_estimator(folder / "p.onnx")
    refusal(load_estimator, folder / "p.onnx")


@given(data=st.data())
@settings(max_examples=30)
def test_a_description_of_a_network_is_taken_or_refused_in_one_line(folder, data):
    changed = data.draw(mutated(DESCRIPTION))
    (folder / "p.onnx").write_bytes(policy([node("Tanh")], description=changed))
    refusal(load_estimator, folder / "p.onnx")


@pytest.mark.parametrize(
    ("arrays", "fault"),
    [
        ({}, "'heads' is missing"),
        ({"heads": np.array("[1]")}, "heads: input must be|heads: must be"),
        ({"heads": np.array(HEAD)}, "'track_0' is missing"),
        (
            {"heads": np.array('[{"noise": "n", "level": 1, "methods": []}]'), "track_0": np.ones(3)},
            "of shape",
        ),
        ({"heads": np.array("[" * 100_000)}, "nested too deeply"),
        ({"heads": np.array([{}], dtype=object)}, "numbers and text alone are read"),
        ({"heads": np.zeros(2**24)}, "unpacks to"),
    ],
    ids=range(7),
)
def test_arrays_that_are_no_tracks_are_refused(arrays, fault, folder):
    np.savez_compressed(folder / "t.npz", **arrays)
    with pytest.raises(InputError, match=fault):
        load_tracks(folder / "t.npz")
    refusal(load_tracks, folder / "t.npz")
