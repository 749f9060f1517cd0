"""An export as LeRobot itself reads it, where that is installed: it brings gigabytes, and older packages."""

import dataclasses
import io

import numpy as np
import pytest
from PIL import Image
from recorded import make_episode

from twin.export.columns import video_key
from twin.export.lerobot import write_lerobot
from twin.recording.camera import Pictures

pytestmark = pytest.mark.slow
TOLERANCE_S = 1e-4  # of LeRobot


@pytest.fixture
def read():
    reader = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    return lambda root: reader.LeRobotDataset("local/endotwin", root=root, video_backend="pyav")


def test_an_hour_at_50_samples_a_second_is_read(tmp_path, read):
    hour = make_episode(180_000, vertebrae=1, elements=1)
    write_lerobot(tmp_path, [("hour", hour, {})])
    dataset = read(tmp_path)
    assert (dataset.num_frames, dataset.num_episodes, dataset.fps) == (180_000, 4, 50)
    for k in (0, 1, 44_999, 45_000, 179_999):
        frame = dataset[k]
        assert frame["truth.bend_deg"].item() == pytest.approx(hour.truth_deg[k], rel=1e-6)
        assert frame["action"].item() == pytest.approx(hour.pull_mm[k], rel=1e-6)
        assert frame["episode_index"].item() == k // 45_000
    frames = dataset.hf_dataset.with_format("numpy")
    steps = np.diff(frames["timestamp"][:])[np.diff(frames["episode_index"][:]) == 0]
    assert np.abs(steps - 1 / 50).max() < TOLERANCE_S


def test_each_frame_of_a_long_film_is_found_at_its_time(tmp_path, read):
    long = dataclasses.replace(make_episode(19_990), time=np.arange(19_990) * 0.1)
    shades = (20, 90, 160, 230)
    jpegs = []
    for shade in shades:
        file = io.BytesIO()
        Image.new("RGB", (64, 48), (shade, 128, 255 - shade)).save(file, "JPEG")
        jpegs.append(file.getvalue())
    seen = Pictures(long.time, tuple(jpegs[k % 4] for k in range(19_990)), (64, 48))
    write_lerobot(tmp_path, [("long", long, {"camera": seen})])
    dataset = read(tmp_path)
    assert dataset.num_episodes == 2
    for k in (0, 9_993, 9_994, 9_995, 19_988, 19_989):
        picture = dataset[k][video_key("camera")]
        assert picture.shape == (3, 48, 64)
        assert 255 * picture[0, 24, 32] == pytest.approx(shades[k % 4], abs=12)
