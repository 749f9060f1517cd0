"""Films are written whole, frame by frame as they were drawn, or not at all."""

import av
import numpy as np
import pytest
from PIL import Image
from rendered import SMALL, film, make_episode, needs_gl

from twin.rendering.look import Look
from twin.rendering.render import render
from twin.rendering.video import read_frames

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
