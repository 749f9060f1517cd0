"""Films are written complete, frame by frame as they were drawn, or not at all."""

import av
import numpy as np
import pytest
from PIL import Image
from rendered import SMALL, film, make_episode, needs_gl

from twin.rendering.look import Look
from twin.rendering.render import render
from twin.rendering.video import count_frames, read_frames, write_video

LOOK = Look(size=SMALL)


@needs_gl
def test_mp4_decodes_to_every_frame(tmp_path):
    seen = []
    path = render(
        make_episode(),
        str(tmp_path / "bend.mp4"),
        look=LOOK,
        fps=10,
        speed=2,
        progress=lambda done, count: seen.append((done, count)),
    )
    with av.open(str(path)) as movie:
        stream = movie.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert stream.average_rate == 10
        frames = [frame.to_ndarray(format="rgb24") for frame in movie.decode(stream)]
    assert len(frames) == 21  # 4 s at double speed, both ends included
    drawn = film(make_episode(), speed=2).frame(10)
    assert frames[5].shape == drawn.shape == (180, 320, 3)
    assert np.abs(frames[5].astype(int) - drawn).mean() < 3
    assert seen == [(done, 21) for done in range(1, 22)]
    assert [file.name for file in tmp_path.iterdir()] == ["bend.mp4"]


@needs_gl
def test_gif_shows_every_frame_in_its_colours_and_goes_round(tmp_path):
    path = render(make_episode(), tmp_path / "bend.GIF", look=LOOK, fps=10, speed=2)
    with Image.open(path) as movie:
        assert movie.n_frames == 21
        assert movie.info["loop"] == 0
        movie.seek(5)
        assert movie.info["duration"] == 100
        shown = np.asarray(movie.convert("RGB")).astype(int)
    drawn = film(make_episode(), speed=2).frame(10)
    assert np.abs(shown - drawn).mean() < 3
    red = (shown[..., 0] - shown[..., 2] > 80) & (shown[..., 0] - shown[..., 1] > 80)
    assert red.sum() > 100  # the trace: red and blue are not exchanged
    again = render(make_episode(), path, look=LOOK, fps=10, speed=2)  # it bears our sign
    assert [file.name for file in tmp_path.iterdir()] == [again.name]


@needs_gl
@pytest.mark.parametrize("name", ["bend.mp4", "bend.gif"])
def test_a_film_that_is_interrupted_leaves_nothing(tmp_path, name):
    def stop(done: int, count: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(make_episode(), tmp_path / name, look=LOOK, progress=stop)
    assert list(tmp_path.iterdir()) == []


@needs_gl
def test_the_ending_of_the_path_says_what_is_drawn(tmp_path):
    episode = make_episode()
    assert render(episode, tmp_path / "bend.PNG", look=LOOK) == tmp_path / "bend.PNG"
    render(episode, tmp_path / "same.png", look=LOOK)
    assert (tmp_path / "bend.PNG").read_bytes() == (tmp_path / "same.png").read_bytes()
    render(episode, tmp_path / "bend.mp4", fps=5, speed=2.0, look=LOOK)
    frames = read_frames(tmp_path / "bend.mp4", 100)
    assert len(frames) == 11  # 4 s at twice the speed, both ends
    assert frames[0].shape == (180, 320, 3)


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
