"""Pictures of a camera: taken at the right samples, of the right size, and found in the file of a dataset."""

import io

import numpy as np
import pytest
from PIL import Image
from recorded import messages
from small_dataset import SMALL, changed, make

from twin.dataset.verify import replay, verify
from twin.episode import Episode
from twin.physics import choose_backend, simulate
from twin.preset.file import load_preset
from twin.recording import read_episode
from twin.rendering.camera import Camera, pictures
from twin.rendering.cameras import SIZE, Portrait

needs_gl = pytest.mark.skipif(choose_backend() == "disable", reason="nothing here draws without a screen")
SAMPLE_TIME = 0.02
TINY_CAMERA = Camera(10.0, 80, 120)


@pytest.fixture(scope="module")
def episode() -> Episode:
    """A second in which the tip rises."""
    return simulate(SMALL, np.linspace(0, 3e-3, 50), SAMPLE_TIME)


@needs_gl
@pytest.mark.parametrize("rate", [0.5, 7.0, 50.0, 1000.0])
def test_picture_shows_the_latest_sample_at_its_time(episode, rate):
    expected, number = [], 0
    while (time := number / rate) <= 0.98 + 1e-9:
        expected.append(max(k for k in range(50) if k * SAMPLE_TIME <= time + 1e-9))
        number += 1
    assert [sample for sample, _ in pictures(episode, Camera(rate, 80, 120))] == sorted(set(expected))


@needs_gl
@pytest.mark.parametrize(("width", "height"), [(80, 120), (122, 360)])
def test_picture_is_a_jpeg_of_the_size_asked_for_that_shows_the_pose(episode, width, height):
    drawn = []
    for _, jpeg in pictures(episode, Camera(2.0, width, height)):
        picture = Image.open(io.BytesIO(jpeg))
        assert picture.format == "JPEG"
        assert picture.size == (width, height)
        drawn.append(np.asarray(picture).astype(int))
    assert np.abs(drawn[0] - drawn[-1]).max() > 100  # the tip rises


@needs_gl
def test_pictures_of_a_dataset_are_read_by_the_public_reader_at_their_times(tmp_path):
    recipe = changed(episodes=2, camera=TINY_CAMERA)
    make(tmp_path / "seen", recipe)
    make(tmp_path / "unseen", changed(episodes=2))
    for number in range(2):
        name = f"episode_000{number}.mcap"
        episode, seen = read_episode(tmp_path / "seen" / name), messages(tmp_path / "seen" / name)
        expected = list(pictures(episode, TINY_CAMERA))
        assert [sample for sample, _ in expected] == list(range(0, 50, 5))
        for (sample, jpeg), (record, message) in zip(expected, seen["/camera/image"], strict=True):
            nanoseconds = sample * 20_000_000
            assert record.log_time == record.publish_time == nanoseconds
            assert message.timestamp.ToNanoseconds() == nanoseconds
            assert (message.format, message.frame_id) == ("jpeg", "camera")
            assert message.data == jpeg
        without = read_episode(tmp_path / "unseen" / name)
        np.testing.assert_array_equal(episode.bend, without.bend)  # a camera changes nothing else
        assert "/camera/image" not in messages(tmp_path / "unseen" / name)
    assert verify(tmp_path / "seen") == ([], 2)
    assert replay(tmp_path / "seen" / "episode_0001.mcap").same


@needs_gl
def test_dataset_with_pictures_is_the_same_bytes_again_and_resumed(tmp_path):
    recipe = changed(episodes=2, seconds=0.4, camera=TINY_CAMERA)
    made = [make(tmp_path / name, recipe).contents for name in ("one", "two")]
    assert made[0] == made[1]
    (tmp_path / "two" / "episode_0000.mcap").unlink()
    again = make(tmp_path / "two", recipe)
    assert again.contents == made[0]
    assert again.kept == 1


def test_system_that_cannot_draw_is_said_in_one_line_and_leaves_nothing_half(tmp_path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    with pytest.raises(OSError, match="nothing here can draw without a screen") as refused:
        make(tmp_path, changed(camera=TINY_CAMERA))
    assert "\n" not in str(refused.value)
    assert {path.name for path in tmp_path.iterdir()} == {"recipe.yaml"}


def inked(picture):
    return picture.min(axis=2) < 200


@pytest.fixture(scope="module")
def portrait():
    return Portrait(load_preset("ureteroscope"))


@needs_gl
@pytest.mark.parametrize("bend_deg", [-200.0, -60.0, 0.0, 133.0])
def test_every_arc_is_whole_in_the_picture(portrait, bend_deg):
    picture = portrait.picture(np.full(16, np.radians(bend_deg) / 16))
    assert picture.shape == (SIZE, SIZE, 3)
    drawn = inked(picture)
    edge = np.concatenate([drawn[0], drawn[-1], drawn[:, -1]])  # the shaft comes in from the left
    assert not edge.any()
    assert drawn[:, SIZE // 3 :].any()  # ahead of the shaft
