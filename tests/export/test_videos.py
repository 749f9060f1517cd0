"""Pictures of a camera become the video of a LeRobot dataset: a picture for each frame, at its time."""

import io
import json

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from exporting import run
from PIL import Image
from recorded import make_episode

import twin
from twin.export.columns import statistics, video_key
from twin.recording.camera import CAMERA_TOPIC, decoded, picture_message, stereo_topics
from twin.recording.messages import to_nanoseconds
from twin.recording.writer import EpisodeWriter

VIDEO_KEY = video_key("camera")
SAMPLES, EVERY = 20, 5  # a picture at each fifth sample
SIDES = (64, 48)
SHADES = (20, 90, 160, 230)


def picture(shade: int, size: tuple[int, int] = SIDES) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.full((size[1], size[0], 3), (shade, 128, 255 - shade), np.uint8)).save(file, "JPEG")
    return file.getvalue()


def write_record(path, *, seed=0, size=SIDES, jpeg=None):
    """A record with a picture at each fifth sample, from the third on."""
    episode = make_episode(SAMPLES, seed=seed)
    with EpisodeWriter(path) as writer:
        writer.write(episode)
        times = to_nanoseconds(episode.time)
        for k in range(len(SHADES)):
            message = picture_message(jpeg or picture(SHADES[k], size), int(times[2 + EVERY * k]))
            writer.add_message(CAMERA_TOPIC, message, int(times[2 + EVERY * k]))
    return episode


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "data").mkdir()
    for seed in range(2):
        write_record(tmp_path / "data" / f"episode_000{seed}.mcap", seed=seed)
    return tmp_path / "data"


def frames_of(path) -> np.ndarray:
    with av.open(str(path)) as film:
        return np.array([frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)])


def test_every_frame_of_the_table_has_its_picture_in_the_film(folder, tmp_path, capsys):
    code, _, said = run(capsys, folder, "--out", tmp_path / "out")
    assert code == 0, said
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    feature = info["features"][VIDEO_KEY]
    assert (feature["dtype"], feature["shape"]) == ("video", [SIDES[1], SIDES[0], 3])
    assert feature["info"]["video.fps"] == info["fps"]
    rows = pq.read_table(tmp_path / "out/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    for seed, row in enumerate(rows):
        place = {"chunk_index": row[f"videos/{VIDEO_KEY}/chunk_index"]}
        place |= {"file_index": row[f"videos/{VIDEO_KEY}/file_index"], "video_key": VIDEO_KEY}
        assert place["file_index"] == seed
        frames = frames_of(tmp_path / "out" / info["video_path"].format(**place))
        assert len(frames) == row["length"] == SAMPLES
        assert row[f"videos/{VIDEO_KEY}/to_timestamp"] == pytest.approx(SAMPLES / info["fps"])
        expected = [SHADES[max(k - 2, 0) // EVERY] for k in range(SAMPLES)]
        np.testing.assert_allclose(frames[:, 24, 32, 0], expected, atol=12)


def test_pictures_are_read_with_their_times(folder):
    (camera, seen), *others = twin.read_pictures(folder / "episode_0000.mcap").items()
    assert (camera, others, seen.size) == ("camera", [], SIDES)
    np.testing.assert_allclose(seen.time, (2 + EVERY * np.arange(4)) * 0.02)
    shades = [shown[24, 32, 0] for shown in seen.at(seen.time)]
    np.testing.assert_allclose(shades, SHADES, atol=3)


def test_a_long_record_has_a_film_for_each_of_its_episodes(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("twin.export.lerobot.LONGEST", 0.3)
    _, said, _ = run(capsys, folder, "--out", tmp_path / "out")
    assert "2 episodes, 0.8 s, as parquet" in said
    assert "split: 4 LeRobot episodes" in said
    films = sorted((tmp_path / f"out/videos/{VIDEO_KEY}/chunk-000").iterdir())
    assert [len(frames_of(film)) for film in films] == [10] * 4
    frames = np.concatenate([frames_of(film) for film in films[:2]])
    expected = [SHADES[max(k - 2, 0) // EVERY] for k in range(SAMPLES)]
    np.testing.assert_allclose(frames[:, 24, 32, 0], expected, atol=12)


def test_statistics_of_the_video_are_those_of_its_pixels(folder, tmp_path, capsys):
    run(capsys, folder, "--out", tmp_path / "out")
    stated = json.loads((tmp_path / "out/meta/stats.json").read_text())[VIDEO_KEY]
    assert np.shape(stated["mean"]) == (3, 1, 1)
    pictures = [decoded(picture(SHADES[max(k - 2, 0) // EVERY])) for k in range(SAMPLES)]
    known = statistics(np.concatenate([shown.reshape(-1, 3) for shown in pictures]) / 255)
    for name in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(np.ravel(stated[name]), known[name], atol=0.02)


def test_thinning_keeps_pictures_by_their_time(folder, tmp_path, capsys):
    episode = make_episode(SAMPLES, seed=0)
    words = (folder, "--sample-time", 2 * episode.sample_time, "--out")
    code, said, _ = run(capsys, *words, tmp_path / "out")
    assert code == 0
    assert "; with the pictures of 2 as video" in said
    _, said, _ = run(capsys, *words, tmp_path / "csv", "--format", "csv")
    assert "; without the pictures of 2, which parquet would hold as video" in said
    frames = frames_of(tmp_path / f"out/videos/{VIDEO_KEY}/chunk-000/file-000.mp4")
    expected = [SHADES[max(k - 2, 0) // EVERY] for k in range(0, SAMPLES, 2)]
    np.testing.assert_allclose(frames[:, 24, 32, 0], expected, atol=12)


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"size": (32, 48)}, "has pictures of 32 x 48, episode_0000 has pictures of 64 x 48"),
        ({"jpeg": b"no picture"}, "a picture is no JPEG file"),
    ],
)
def test_pictures_that_do_not_fit_are_one_line(folder, tmp_path, capsys, change, rule):
    write_record(folder / "episode_0001.mcap", seed=1, **change)
    code, _, said = run(capsys, folder, "--out", tmp_path / "out")
    assert code == 2
    assert rule in said
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_two_cameras_are_two_films(tmp_path, capsys):
    (tmp_path / "data").mkdir()
    episode = make_episode(SAMPLES, seed=0)
    times = to_nanoseconds(episode.time)
    with EpisodeWriter(tmp_path / "data/episode_0000.mcap") as writer:
        writer.write(episode)
        for side, shade in (("left", 40), ("right", 200)):
            writer.add_message(stereo_topics(side)[0], picture_message(picture(shade), times[0]), times[0])
    code, _, said = run(capsys, tmp_path / "data", "--out", tmp_path / "out")
    assert code == 0, said
    for side, shade in (("left", 40), ("right", 200)):
        frames = frames_of(tmp_path / f"out/videos/{video_key(side)}/chunk-000/file-000.mp4")
        assert len(frames) == SAMPLES
        np.testing.assert_allclose(frames[:, 24, 32, 0], shade, atol=12)
