"""Films are written complete, frame by frame as they were drawn, or not at all."""

import av
import numpy as np
import pytest
from PIL import Image
from rendered import SMALL, film, make_episode, needs_gl

from twin.rendering.look import Look
from twin.rendering.render import render
from twin.rendering.video import write_video

LOOK = Look(size=SMALL)
GREYS = [np.full((48, 64, 3), 40 + 30 * number, np.uint8) for number in range(7)]


def frames_of(path) -> np.ndarray:
    with av.open(str(path)) as movie:
        return np.array([frame.to_ndarray(format="rgb24") for frame in movie.decode(video=0)])


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
    frames = frames_of(path)
    drawn = film(make_episode(), speed=2).frame(10)
    assert frames.shape == (21, *drawn.shape)  # 4 s at double speed, both ends included
    assert np.abs(frames[5].astype(int) - drawn).mean() < 3
    assert seen == [(done, 21) for done in range(1, 22)]
    assert [file.name for file in tmp_path.iterdir()] == ["bend.mp4"]


@needs_gl
def test_gif_shows_every_frame_in_its_colours_and_repeats(tmp_path):
    path = render(make_episode(), tmp_path / "bend.GIF", look=LOOK, fps=5, speed=2)
    with Image.open(path) as movie:
        assert movie.n_frames == 11
        assert (movie.info["loop"], movie.info["duration"]) == (0, 200)
        movie.seek(5)
        shown = np.asarray(movie.convert("RGB")).astype(int)
    assert np.abs(shown - film(make_episode(), speed=2).frame(20)).mean() < 3
    red = (shown[..., 0] - shown[..., 2] > 80) & (shown[..., 0] - shown[..., 1] > 80)
    assert red.sum() > 100  # the trace: red and blue are not exchanged


@needs_gl
@pytest.mark.parametrize("name", ["bend.mp4", "bend.gif"])
def test_a_film_that_is_interrupted_leaves_nothing(tmp_path, name):
    def stop(done: int, count: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(make_episode(), tmp_path / name, look=LOOK, progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_the_previous_film_and_names_it(small_disk):
    disk = small_disk(64)
    write_video(disk / "a.mp4", GREYS, 10, 64, 48)
    before = (disk / "a.mp4").read_bytes()
    noise = np.random.default_rng(0).integers(0, 255, (60, 48, 64, 3), dtype=np.uint8)
    with pytest.raises(OSError, match="No space left") as caught:
        write_video(disk / "a.mp4", list(noise), 10, 64, 48)
    assert caught.value.filename == str(disk / "a.mp4")
    assert [path.name for path in disk.iterdir()] == ["a.mp4"]
    assert (disk / "a.mp4").read_bytes() == before
