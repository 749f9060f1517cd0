"""Any trained file is loaded by one function, without torch, and runs sample by sample."""

import json
import subprocess
import sys

import briefly
import numpy as np
import onnx
import pytest
from faulty_stream import run_faulty
from small_twins import TINY

from rl.options import TrainingOptions
from rl.trainers import Material, Simulated, find_trainer
from twin.estimation.active_model import ActiveModel
from twin.estimation.deployment import Deployment
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.learned.trained_file import read_trained_file
from twin.estimation.load import load_estimator, model_of
from twin.estimation.registry import trainings
from twin.live import load_runtime, prepare_runtime
from twin.live.online import OnlineEstimator
from twin.preset import load_preset, load_ranges

PRESET, RANGES = load_preset("ureteroscope"), load_ranges("ureteroscope")
FEW = {"episodes": 16, "environments": 8, "horizon": 256, "minibatch": 64}
OFTEN = ("ram", "lstm", "ram-twins")
AGENTS = [
    agent if agent in OFTEN else pytest.param(agent, marks=pytest.mark.slow)
    for agent in sorted(trainings().keys() - {"own"})
]


@pytest.fixture(scope="module", params=AGENTS)
def trained(request, records, model, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    options = TrainingOptions(agent=request.param, seed=1, **FEW)
    tiny = ("noises", "episode", "noise_model_sequences", "interval_sequences")
    of_twins = {
        name: getattr(TINY, name) for name in tiny if request.param == "ram-twins" or name == "noises"
    }
    simulated = Simulated(PRESET, RANGES, of_twins)
    material = Material(records, ActiveModel(model, 0.1), simulated)
    with pytest.MonkeyPatch.context() as patch:
        briefly.choose_members(patch)
        return find_trainer(request.param).run(material, options, folder)


def test_it_filters_and_a_stream_gives_what_the_record_gives(trained, records):
    estimator = load_estimator(trained).with_sensor(Sensor(0.3))
    pull, bend = records[0]
    measurement = bend + np.random.default_rng(0).standard_normal(len(bend))
    batch = Estimator.estimate(estimator, pull, measurement, bend[0] + 5)[0]
    live = OnlineEstimator(estimator, estimator.sample_time, bend[0] + 5)
    stream = [live.push(0.1 * k, pull[k], measurement[k]) for k in range(len(pull))]
    np.testing.assert_array_equal(stream, batch)
    np.testing.assert_allclose(estimator.estimate(pull, measurement, bend[0] + 5)[0], batch, atol=1e-3)
    assert estimator.sample_time == 0.1


def test_it_survives_a_faulty_stream_and_is_back_within_5_s(trained):
    estimator = load_estimator(trained).with_sensor(Sensor(0.1))
    _, off = run_faulty(estimator, estimator.sample_time, 3000, seed=1)
    assert max(off.values()) < 3, off


def test_the_file_tells_the_model_and_how_it_was_trained(trained, model):
    if trainings()[read_trained_file(trained).agent].on_twins:
        with pytest.raises(ValueError, match="does not state the model"):
            model_of(trained)
    else:
        assert model_of(trained) == model
    (described,) = [item.value for item in onnx.load(trained).metadata_props if item.key == "endotwin"]
    assert json.loads(described)["training"]["seed"] == 1


def test_it_runs_where_neither_torch_nor_mujoco_can_be_imported(trained):
    code = (
        "import sys\n"
        "for name in ('torch', 'stable_baselines3', 'gymnasium', 'mujoco', 'dm_control', 'matplotlib'):\n"
        "    sys.modules[name] = None\n"
        "import numpy as np\n"
        "from twin.estimation.estimator import Sensor\n"
        "from twin.estimation.load import load_estimator\n"
        f"estimator = load_estimator({str(trained)!r}, Sensor(0.1))\n"
        "pull = np.sin(np.arange(50) / 9)\n"
        "print(np.isfinite(estimator.estimate(pull, 10 * pull, 3.0)).all())\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "True", done.stderr[-500:]


def test_its_file_is_all_that_a_runtime_needs(trained, records, model):
    runtime = load_runtime(trained, noise_variance=0.2, initial_bend_deg=60.0)
    pull, bend = records[0]
    readings = [runtime.push(0.1 * k, pull[k], bend[k]) for k in range(100)]
    assert all(reading.low_deg <= reading.bend_deg <= reading.high_deg for reading in readings)
    assert runtime.fallback.estimator.measurement_variance == 0.2
    low, high = Deployment.from_dict(read_trained_file(trained).description["deployment"]).pull_mm
    if trainings()[read_trained_file(trained).agent].on_twins:
        assert load_runtime(trained, sample_time=0.02).fallback.estimator.sample_time == 0.02
        assert (low, high) == pytest.approx((-4.8, 4.8), abs=0.1)
    else:
        assert runtime.fallback.estimator.model == model
        assert low < pull.min() < pull.max() < high
        with pytest.raises(
            ValueError, match=r"sample_time = 0.02: .* was trained at 0.1 s, and runs at no other"
        ):
            load_runtime(trained, sample_time=0.02)


def test_streams_of_one_reading_are_those_of_readings_of_their_own(trained, records):
    """One sample of each in turn: they share what was read, and nothing that moves."""
    prepared = prepare_runtime(trained, noise_variance=0.2)
    pairs = [
        (prepared(begin), load_runtime(trained, noise_variance=0.2, initial_bend_deg=begin))
        for begin in (50.0, 70.0)
    ]
    for k in range(80):
        for (shared, own), (pull, bend) in zip(pairs, (records[0], records[1]), strict=True):
            assert shared.push(0.1 * k, pull[k], bend[k]) == own.push(0.1 * k, pull[k], bend[k])


def test_a_runtime_refuses_what_holds_no_fallback_and_numbers_that_cannot_be(trained, tmp_path):
    with pytest.raises(ValueError, match="noise_variance = 0: must be positive"):
        load_runtime(trained, noise_variance=0.0)
    with pytest.raises(ValueError, match="sample_time = -1: must be positive"):
        load_runtime(trained, sample_time=-1.0)
    older = onnx.load(trained)
    (described,) = [item for item in older.metadata_props if item.key == "endotwin"]
    values = json.loads(described.value)
    del values["deployment"]
    described.value = json.dumps(values)
    onnx.save(older, tmp_path / "older.onnx")
    with pytest.raises(ValueError, match="holds no fallback: an earlier version wrote it; train again"):
        load_runtime(tmp_path / "older.onnx")


def test_what_is_no_trained_file_is_refused_in_one_line(tmp_path, trained):
    path = tmp_path / "x.onnx"
    with pytest.raises(FileNotFoundError, match="no trained file"):
        load_estimator(path)
    whole = trained.read_bytes()
    for content in (b"", b"nothing", whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="is not a trained file") as error:
            load_estimator(path)
        assert "\n" not in str(error.value)
    graph = onnx.load(trained)
    description = json.loads(graph.metadata_props[0].value)
    for change, said in (
        ({"agent": "dqn"}, "unknown agent 'dqn'; valid"),
        ({"agent": 3}, "is not a trained file"),
        ({"active_model": {}, "members": {}, "model": {}}, r"is not a policy|is no trained file"),
    ):
        onnx.helper.set_model_props(graph, {"endotwin": json.dumps(description | change)})
        onnx.save(graph, path)
        with pytest.raises(ValueError, match=said):
            load_estimator(path)
