"""Films: MP4 files (H.264, 4:2:0, which every browser plays), written whole or not at all, and read."""

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError
from twin.files.atomic import WholeFile
from twin.files.ours import MADE_BY

Picture = NDArray[np.uint8]

CODEC = "libx264"
_OPTIONS = {"crf": "20", "threads": "1"}  # one thread: the bytes do not depend on the machine
LARGEST_FRAMES = 1_000_000
"""Frames of a film at most: eleven hours at 25 per second."""


def write_video(path: Path, frames: Iterable[Picture], fps: int, width: int, height: int) -> None:
    """Write frames as a film.

    Args:
        path: the MP4 to write.
        frames: pictures (height, width, 3), drawn one by one.
        fps: frames per second.
        width: of a frame [pixels], even.
        height: of a frame [pixels], even.

    Raises:
        FileNotFoundError: the folder does not exist.
        OSError: the disk is full or fails, or the file does not hold what was written.
    """
    av.logging.set_level(av.logging.PANIC)  # what is wrong is raised
    whole = WholeFile(path)
    count = 0
    with whole:
        # Its index stands in front, so that a browser begins before all is loaded.
        film: Any = av.open(whole.open_path, "w", format="mp4", options={"movflags": "+faststart"})
        with film:
            film.metadata["comment"] = MADE_BY
            stream = film.add_stream(CODEC, rate=fps, options=_OPTIONS)
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            for frame in frames:
                film.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
                count += 1
            film.mux(stream.encode(None))
        written = count_frames(Path(whole.open_path))
        if written != count:
            raise OSError(f"{path}: {written} of {count} frames were written")


def count_frames(path: Path) -> int:
    """Return the number of frames of a film, without decoding them.

    Raises:
        ValueError: it is no film.
    """
    with _opened(path) as film:
        return sum(packet.size > 0 for packet in film.demux(video=0))


def read_frames(path: Path, count: int) -> list[Picture]:
    """Return some frames (height, width, 3) of a film, evenly from the first to the last.

    Args:
        path: of the film.
        count: how many; as many as there are, if there are fewer.

    Raises:
        ValueError: it is no film, or has no frames.
    """
    total = count_frames(path)
    if not 0 < total <= LARGEST_FRAMES:
        raise InputError(f"{path} is no film of 1 to {LARGEST_FRAMES} frames: it has {total}")
    wanted = set(np.linspace(0, total - 1, count).astype(int).tolist())
    with _opened(path) as film:
        decoded = enumerate(film.decode(video=0))
        return [frame.to_ndarray(format="rgb24") for number, frame in decoded if number in wanted]


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Context manager: a film; whatever FFmpeg finds wrong with it is a ValueError that names the file."""
    av.logging.set_level(av.logging.PANIC)
    try:
        with av.open(str(path), format="mp4") as film:
            if not film.streams.video:
                raise InputError("it has no pictures")
            yield film
    except (av.FFmpegError, InputError) as error:
        raise InputError(f"{path} is no film: {error}") from error
