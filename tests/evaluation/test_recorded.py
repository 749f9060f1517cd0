"""Recorded measurements reach the estimators, and their estimates reach a file that a viewer reads."""

import dataclasses
import json

import numpy as np
import pytest
from mcap_protobuf.reader import read_protobuf_messages
from recorded import assert_equal, make_episode
from small_dataset import RECIPE, make, measured_log

from scripts import evaluate as verb
from twin.dataset.recipe import Recipe
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import Case
from twin.evaluation.compare import compare, write_estimates
from twin.evaluation.method import Method, as_method, make_case
from twin.evaluation.protocol import Protocol
from twin.evaluation.reading import chosen_measurements, common_variance, evaluation_record, recorded_variance
from twin.export.export import named_files
from twin.measured.folder import write_measured
from twin.recording import episode_files, read_episode
from twin.recording.messages import estimate_topic

RECORDED = Protocol("paper", 1, 0.02, recorded_variance=0.3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A dataset whose sensor reads every 0.1 s, a tenth of a second late, in steps of half a degree."""
    folder = tmp_path_factory.mktemp("recorded") / "data"
    preset = RECIPE.preset.replace(
        sensor_period=0.1, sensor_latency=0.1, sensor_resolution=np.radians(0.5), sensor_noise=0.01
    )
    make(folder, dataclasses.replace(RECIPE, preset=preset, seconds=2.0, sensor_variance_deg2=0.04))
    return folder


def test_methods_get_what_the_sensor_saw_with_its_rate_latency_and_resolution(folder):
    episodes = [read_episode(path) for path in episode_files(folder)]
    records = [evaluation_record(episode, k) for k, episode in enumerate(episodes)]
    seen: list[Case] = []

    def look(case: Case) -> np.ndarray:
        seen.append(case)
        return case.measurement_deg

    scores, *_ = compare(records, [Method("y", look)], RECORDED)
    (case,) = seen
    for row, episode in zip(case.measurement_deg, episodes, strict=True):
        np.testing.assert_array_equal(row, episode.measured_deg)
    np.testing.assert_array_equal(case.sensor.variance, [0.3] * len(records))
    (score,) = scores
    errors = np.concatenate([(e.measured_deg - e.truth_deg)[1:] for e in episodes])
    assert score.rmse_deg == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert (score.noise, score.level, score.seeds) == ("recorded", 0.3, 1)


def test_variance_is_that_of_the_sensor_and_of_the_recipe(folder):
    episode = read_episode(episode_files(folder)[0])
    expected = np.degrees(0.01) ** 2 + 0.5**2 / 12 + 0.04
    assert recorded_variance(episode) == pytest.approx(expected)
    assert common_variance([folder]) == (pytest.approx(expected), True)


@pytest.fixture
def logs(tmp_path):
    """A folder of one measured log."""
    (tmp_path / "data").mkdir()
    write_measured(tmp_path / "data", "log", measured_log(tmp_path))
    return tmp_path / "data"


def test_measured_logs_keep_their_measurements_unless_noise_is_asked_for(folder, logs):
    simulated = len(episode_files(folder))
    assert chosen_measurements("auto", [folder]) == ("drawn", "")
    assert chosen_measurements("recorded", [folder]) == ("recorded", "")
    chosen, line = chosen_measurements("auto", [logs])
    assert chosen == "recorded"
    assert line.startswith(
        "1 of 1 records are measured logs: estimators get their recorded measurements, and"
    )
    for asked, paths, count in (("drawn", [logs], 1), ("auto", [folder, logs], simulated + 1)):
        chosen, line = chosen_measurements(asked, paths)
        assert chosen == "drawn"
        assert line == (
            f"1 of {count} records are measured logs: their angles are taken for true, and noise is drawn on "
            "top of them"
        )
    with pytest.raises(ValueError, match="measurements = 'both': must be auto, drawn or recorded"):
        chosen_measurements("both", [logs])


def test_a_record_without_measurements_is_refused(folder):
    record = evaluation_record(read_episode(episode_files(folder)[0]), 0)
    bare = dataclasses.replace(record, measured_deg=np.full(len(record.time), np.nan))
    with pytest.raises(ValueError, match="holds no measurement"):
        make_case([(0, bare)], RECORDED)


def test_what_is_known_of_the_zero_of_recorded_measurements_is_stated(folder, capsys, tmp_path, model):
    record = evaluation_record(read_episode(episode_files(folder)[0]), 0)
    for stated in (0.0, 0.7):
        case = make_case([(0, record)], dataclasses.replace(RECORDED, sensor_zero_deviation_deg=stated))
        assert case.sensor.zero_deviation_deg.tolist() == [stated]
    assert make_case([(0, record)], RECORDED).sensor.zero_deviation_deg.tolist() == [2.0]
    (tmp_path / "model.json").write_text(json.dumps(model.to_dict()))
    line = f"{folder} --model {tmp_path}/model.json --measurements drawn --sensor-zero-deviation-deg 0"
    line += f" --out {tmp_path}/out"
    assert verb.main(line.split()) == 2
    assert "--sensor-zero-deviation-deg is for --measurements recorded" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_estimates_are_written_with_the_episode(folder, tmp_path, model):
    active_model = ActiveModel(model, 0.1)
    methods = [as_method("AM (toy, x)", active_model), Method("seer", lambda case: 1 / 0, oracle=True)]
    write_estimates(
        named_files([folder]), methods, Protocol("paper", 1, 0.1, recorded_variance=0.3), tmp_path
    )
    written = episode_files(tmp_path)
    assert [path.name for path in written] == [path.name for path in episode_files(folder)]
    episode = read_episode(episode_files(folder)[0])
    assert_equal(read_episode(written[0]), episode)
    messages = list(read_protobuf_messages(written[0], topics=["/estimate/AM_toy_x"]))
    record = evaluation_record(episode.resampled(0.1), 0)
    estimates = dataclasses.replace(active_model, measurement_variance=0.3).estimate(
        record.pull_mm, record.measured_deg, record.filled_deg[0] + 20
    )
    np.testing.assert_allclose([m.proto_msg.estimate_deg for m in messages], estimates[0], rtol=1e-12)
    assert [m.log_time_ns for m in messages] == [100_000_000 * k for k in range(len(estimates[0]))]


def test_the_verb_scores_recorded_measurements_and_writes_estimates(folder, tmp_path, model, capsys):
    (tmp_path / "model.json").write_text(json.dumps(model.to_dict()))
    line = f"{folder} --model {tmp_path}/model.json --measurements recorded --write-estimates --json"
    assert verb.main([*line.split(), "--out", str(tmp_path / "out")]) == 0
    evaluation = json.loads((tmp_path / "out/evaluation.json").read_text())
    assert {row["method"] for row in evaluation["rows"]} == {"C-H", "AM"}
    assert {row["noise"] for row in evaluation["rows"]} == {"recorded"}
    assert {row["method"]: row["given"] for row in evaluation["rows"]} == {"C-H": [], "AM": ["R"]}
    topics = {estimate_topic(name) for name in ("C-H", "AM")}
    for path in episode_files(tmp_path / "out/estimates"):
        assert {message.topic for message in read_protobuf_messages(path)} >= topics
    assert "RMSE [deg]" in capsys.readouterr().err


def test_a_recipe_is_what_tells_the_added_noise():
    episode = make_episode()
    assert recorded_variance(episode) is None
    stated = {"recipe.yaml": b"sensor: {variance_deg2: 0.5}"}
    assert recorded_variance(dataclasses.replace(episode, attachments=stated)) == 0.5
    for damaged in (b"\xff", b"sensor: 3", b"- 1", b"sensor: {variance_deg2: x}"):
        episode = dataclasses.replace(episode, attachments={"recipe.yaml": damaged})
        assert recorded_variance(episode) is None
    assert isinstance(RECIPE, Recipe)
