"""The LeRobot dataset: read back by Arrow alone, and its statistics against NumPy over the whole data."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from exporting import make_full
from recorded import make_episode

from twin.episode import Episode

pq = pytest.importorskip("pyarrow.parquet")

from twin.export.columns import QUANTILES, colour_statistics, frames_per_second, statistics  # noqa: E402
from twin.export.lerobot import LONGEST, write_lerobot  # noqa: E402

PREFIXES = {"observation.state", "action", "truth"}
TOLERANCE_S = 1e-4  # of LeRobot, of a step between two frames
ORDERS = {"timestamp", "frame_index", "episode_index", "index", "task_index"}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Episode]]:
    folder = tmp_path_factory.mktemp("lerobot")
    signals = ("sine", "triangle", "sine")
    episodes = [make_full(30 + 10 * k, k, signal=signal) for k, signal in enumerate(signals)]
    write_lerobot(folder, ((f"record_{k}", episode, {}) for k, episode in enumerate(episodes)))
    return folder, episodes


def column(folder: Path, name: str) -> np.ndarray:
    """(frames, numbers) of all data files, in order."""
    files = sorted((folder / "data").glob("*/*.parquet"))
    rows = [row for file in files for row in pq.read_table(file, columns=[name])[name].to_pylist()]
    return np.array(rows).reshape(len(rows), -1)


def info_of(folder: Path) -> dict:
    return json.loads((folder / "meta" / "info.json").read_text())


def rows_of(folder: Path) -> list[dict]:
    files = sorted((folder / "meta" / "episodes").glob("*/*.parquet"))
    return [row for file in files for row in pq.read_table(file).to_pylist()]


def test_labels_are_the_doubles_of_the_episodes(dataset):
    folder, episodes = dataset
    for name, of in {
        "truth.bend_deg": lambda e: np.degrees(e.bend),
        "truth.lateral_bend_deg": lambda e: np.degrees(e.lateral_bend),
        "truth.pulley_mm": lambda e: e.pulley * 1e3,
        "truth.sheath_bend_deg": lambda e: np.degrees(e.sheath_bend),
        "truth.wire_tension_n": lambda e: e.wire_tension,
        "truth.wire_slack_mm": lambda e: e.wire_slack * 1e3,
        "truth.sheath_friction_n": lambda e: e.sheath_friction,
        "truth.joint_angle_rad": lambda e: e.joint_angle,
        "truth.lateral_joint_angle_rad": lambda e: e.lateral_joint_angle,
    }.items():
        wanted = np.concatenate([of(episode).reshape(len(episode.time), -1) for episode in episodes])
        np.testing.assert_array_equal(column(folder, name), wanted, strict=True)


def test_what_a_robot_knows_and_does_is_rounded_to_float32_and_a_missing_angle_is_nan(dataset):
    folder, episodes = dataset
    seen = [np.column_stack([np.degrees(e.measured_bend), e.wire_tension[:, :, 0]]) for e in episodes]
    commands = [np.column_stack([e.pull, e.lateral_pull]) * 1e3 for e in episodes]
    np.testing.assert_array_equal(column(folder, "observation.state"), np.concatenate(seen).astype("f4"))
    np.testing.assert_array_equal(column(folder, "action"), np.concatenate(commands).astype("f4"))
    assert np.isnan(column(folder, "observation.state")[:, 0]).sum() == 3
    assert pq.read_table(folder / "data")["observation.state"].null_count == 0
    features = info_of(folder)["features"]
    tensions = [f"tension_{wire}_n" for wire in "abcd"]
    assert features["observation.state"]["names"] == ["measured_deg", *tensions]
    assert features["action"]["names"] == ["pull_mm", "lateral_pull_mm"]


def test_info_agrees_with_the_schema_of_every_file(dataset):
    folder, _ = dataset
    info = info_of(folder)
    schema = pq.read_schema(folder / "data" / "chunk-000" / "file-000.parquet")
    assert schema.names == list(info["features"])
    for name, feature in info["features"].items():
        (width,), kind = feature["shape"], schema.field(name).type
        if width > 1:
            assert kind.list_size == width
            kind = kind.value_type
        assert np.dtype(kind.to_pandas_dtype()) == np.dtype(feature["dtype"])
        assert feature["names"] is None if name in ORDERS else len(set(feature["names"])) == width
    assert {name.split(".")[0] if "truth" in name else name for name in schema.names} == PREFIXES | ORDERS
    assert info["codebase_version"] == "v3.0"
    assert (info["fps"], info["total_episodes"], info["total_frames"]) == (50, 3, 120)
    assert (info["total_tasks"], info["splits"], info["robot_type"]) == (2, {"train": "0:3"}, "Öse")
    assert (folder / info["data_path"].format(chunk_index=0, file_index=0)).is_file()


def test_numbers_of_frames_and_episodes_are_those_of_the_rows(dataset):
    folder, episodes = dataset
    lengths = [len(episode.time) for episode in episodes]
    place = np.concatenate([np.arange(length) for length in lengths])
    np.testing.assert_array_equal(column(folder, "frame_index")[:, 0], place)
    np.testing.assert_array_equal(column(folder, "index")[:, 0], np.arange(120))
    np.testing.assert_array_equal(column(folder, "episode_index")[:, 0], np.repeat([0, 1, 2], lengths))
    np.testing.assert_array_equal(column(folder, "task_index")[:, 0], np.repeat([0, 1, 0], lengths))
    np.testing.assert_array_equal(column(folder, "timestamp")[:, 0], (place / 50).astype("f4"))
    rows = rows_of(folder)
    assert [row["dataset_from_index"] for row in rows] == [0, 30, 70]
    assert [row["dataset_to_index"] for row in rows] == [30, 70, 120]
    assert [row["length"] for row in rows] == lengths
    assert [row["source"] for row in rows] == ["record_0", "record_1", "record_2"]
    assert [json.loads(row["metadata"]) for row in rows] == [episode.metadata for episode in episodes]
    tasks = pq.read_table(folder / "meta" / "tasks.parquet").to_pylist()
    assert [[tasks[k]["task"]] for k in (0, 1, 0)] == [row["tasks"] for row in rows]
    assert [task["task_index"] for task in tasks] == [0, 1]
    assert tasks[1]["task"] == "bend the Öse by a triangle command"


def test_tasks_are_looked_up_by_their_words_as_pandas_does(dataset):
    metadata = pq.read_schema(dataset[0] / "meta" / "tasks.parquet").metadata
    pandas = json.loads(metadata[b"pandas"])
    assert pandas["index_columns"] == ["task"]
    assert [entry["field_name"] for entry in pandas["columns"]] == ["task", "task_index"]


def numpy_statistics(values: np.ndarray) -> dict[str, np.ndarray]:
    return {
        "min": np.nanmin(values, axis=0),
        "max": np.nanmax(values, axis=0),
        "mean": np.nanmean(values, axis=0),
        "std": np.nanstd(values, axis=0),
        "count": np.array([(~np.isnan(values)).all(axis=1).sum()]),
    }


def test_statistics_are_those_of_numpy_over_the_dataset_and_over_each_episode(dataset):
    folder, _ = dataset
    stats = json.loads((folder / "meta" / "stats.json").read_text())
    rows = rows_of(folder)
    assert set(stats) == set(info_of(folder)["features"])
    for name, stated in stats.items():
        values = column(folder, name).astype(float)
        parts = [values[row["dataset_from_index"] : row["dataset_to_index"]] for row in rows]
        of_rows = [{key: row[f"stats/{name}/{key}"] for key in stated} for row in rows]
        for part, found in zip([values, *parts], [stated, *of_rows], strict=True):
            wanted = numpy_statistics(part)
            wanted |= {key: np.nanquantile(part, share, axis=0) for key, share in QUANTILES.items()}
            assert set(found) == set(wanted)
            for key in wanted:
                np.testing.assert_allclose(found[key], wanted[key], rtol=1e-12, atol=1e-12, strict=True)


def test_statistics_of_colours_are_those_of_their_pixels():
    pixels = np.random.default_rng(0).integers(0, 256, (301, 3))
    counts = np.stack([np.bincount(colour, minlength=256) for colour in pixels.T], axis=1)
    found = colour_statistics(counts)
    for key, wanted in statistics(pixels / 255).items():
        assert np.shape(found[key]) == ((1,) if key == "count" else (3, 1, 1))
        np.testing.assert_allclose(np.ravel(found[key]), wanted, atol=1e-12)


def test_a_long_record_is_several_episodes_whose_time_stamps_are_exact_enough(tmp_path):
    long = dataclasses.replace(make_episode(10_001), time=3 + np.arange(10_001) * 0.25)
    info = write_lerobot(tmp_path, [("short", long.part(0, 9), {}), ("long", long, {})])
    rows = rows_of(tmp_path)
    assert info["total_episodes"] == 4
    assert [row["source"] for row in rows] == ["short", "long", "long", "long"]
    assert [row["begin_s"] for row in rows] == [3, 3, *(3 + 0.25 * k for k in (3333, 6667))]
    assert sum(row["length"] for row in rows[1:]) == 10_001
    np.testing.assert_array_equal(column(tmp_path, "truth.bend_deg")[9:, 0], long.truth_deg)
    for row in rows:
        part = slice(row["dataset_from_index"], row["dataset_to_index"])
        place = np.arange(row["length"])
        np.testing.assert_array_equal(column(tmp_path, "timestamp")[part, 0], (place / 4).astype("f4"))
        np.testing.assert_array_equal(column(tmp_path, "frame_index")[part, 0], place)


@pytest.mark.parametrize("per_second", [1, 7, 50, 333, 1000])
def test_the_longest_episode_has_steps_within_the_tolerance_of_lerobot(per_second):
    stamps = (np.arange(int(LONGEST * per_second)) / per_second).astype("f4")
    assert np.abs(np.diff(stamps) - 1 / per_second).max() < TOLERANCE_S


def test_uneven_samples_are_no_frames_and_a_sample_time_is_named():
    time = np.arange(12) * 0.02
    assert frames_per_second(dataclasses.replace(make_episode(), time=time + 3)) == 50
    time[5] += 0.003
    with pytest.raises(ValueError, match=r"0\.017 s to 0\.023 s apart: .* such as 0\.02 s"):
        frames_per_second(dataclasses.replace(make_episode(), time=time))
    drifting = np.arange(12) * 0.02 * 1.002
    with pytest.raises(ValueError, match="must be evenly apart, a whole number per second"):
        frames_per_second(dataclasses.replace(make_episode(), time=drifting))


@pytest.mark.parametrize(
    ("other", "fault"),
    [
        (
            make_episode(drive=True),
            "b has 1 columns of truth.pulley_mm, a has no truth.pulley_mm: export them apart",
        ),
        (
            make_episode(elements=3),
            "b has 8 columns of truth.wire_tension_n, a has 6 columns of truth.wire_tension_n",
        ),
        (
            make_episode(elements=None),
            "b has 1 columns of observation.state, a has 3 columns of observation.state",
        ),
        (make_episode(planes=2), "b has 5 columns of observation.state, a has 3 columns of"),
        (
            dataclasses.replace(make_episode(), time=np.arange(12) * 0.01),
            "b has 100 samples per second, a has 50: give a sample time that suits both",
        ),
        (
            dataclasses.replace(make_episode(), time=np.arange(12) * 0.03),
            "b: its samples are 0.03 s apart: must be evenly apart, a whole number per second",
        ),
    ],
)
def test_episodes_that_differ_are_refused_by_name(tmp_path, other, fault):
    with pytest.raises(ValueError, match=fault.replace(".", r"\.")):
        write_lerobot(tmp_path, [("a", make_episode(), {}), ("b", other, {})])


def test_an_angle_that_was_never_measured_and_no_episode_are_refused(tmp_path):
    blind = dataclasses.replace(make_episode(), measured_bend=np.full(12, np.nan))
    with pytest.raises(ValueError, match="measured_deg is missing at every sample of all episodes"):
        write_lerobot(tmp_path / "a", [("a", blind, {})])
    with pytest.raises(ValueError, match="there is no episode"):
        write_lerobot(tmp_path / "b", [])
