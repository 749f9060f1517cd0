"""Films are whole or not there, and one that is damaged is told in one line."""

import av
import numpy as np
import pytest

from twin.rendering.video import count_frames, read_frames, write_video


def pictures(count: int) -> list[np.ndarray]:
    """Plain grey pictures, each brighter than the one before."""
    return [np.full((48, 64, 3), 40 + 200 * number // count, np.uint8) for number in range(count)]


def write(path, frames, fps=10):
    write_video(path, frames, fps, 64, 48)


def test_every_frame_comes_back_in_order(tmp_path):
    written = pictures(7)
    write(tmp_path / "a.mp4", written)
    assert count_frames(tmp_path / "a.mp4") == 7
    with av.open(tmp_path / "a.mp4") as film:
        assert film.streams.video[0].average_rate == 10
    read = read_frames(tmp_path / "a.mp4", 7)
    np.testing.assert_allclose(np.array(read), np.array(written), atol=4)
    ends = read_frames(tmp_path / "a.mp4", 2)
    np.testing.assert_allclose(np.array(ends), np.array([written[0], written[-1]]), atol=4)


def test_the_same_frames_make_the_same_bytes(tmp_path):
    for name in ("a.mp4", "b.mp4"):
        write(tmp_path / name, pictures(5))
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_a_full_disk_leaves_the_film_of_before_and_names_it(small_disk):
    disk = small_disk(64)
    write(disk / "a.mp4", pictures(3))
    before = (disk / "a.mp4").read_bytes()
    noise = np.random.default_rng(0).integers(0, 255, (60, 48, 64, 3), dtype=np.uint8)
    with pytest.raises(OSError, match="No space left") as caught:
        write(disk / "a.mp4", list(noise))
    assert caught.value.filename == str(disk / "a.mp4")
    assert [path.name for path in disk.iterdir()] == ["a.mp4"]
    assert (disk / "a.mp4").read_bytes() == before


@pytest.mark.parametrize("keep", [0, 100, 900])
def test_a_damaged_film_is_refused_by_its_name(tmp_path, keep):
    path = tmp_path / "a.mp4"
    write(path, pictures(3))
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(ValueError, match=r"a\.mp4 is no film"):
        read_frames(path, 2)
