"""Films: MP4 (H.264, 4:2:0, which every browser plays) and GIF, written completely or not at all."""

import itertools
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.video.reformatter import Interpolation
from numpy.typing import NDArray
from PIL import Image

from twin.files.atomic import MADE_BY, WholeFile

Picture = NDArray[np.uint8]
FILMS = (".mp4", ".gif")  # endings of films
CODEC = "libx264"
_OPTIONS = {"crf": "20", "threads": "1"}  # one thread: the bytes do not depend on the machine
LARGEST_FRAMES = 1_000_000  # frames of a film at most: eleven hours at 25 per second
_COLOURS = "yuv420p"
_EXACT = Interpolation.BILINEAR | Interpolation.ACCURATE_RND | Interpolation.BITEXACT
_GIF_COLOURS = 255  # and one for the paper


def write_video(
    path: Path, frames: Iterable[Picture], fps: int, width: int, height: int, sampled: Sequence[Picture] = ()
) -> None:
    """Write frames (height, width, 3) as a film, in the format of the path's ending."""
    av.logging.set_level(av.logging.PANIC)  # errors are raised
    if path.suffix.lower() == ".gif":
        _write_gif(path, frames, fps, width, height, sampled)
        return
    whole = WholeFile(path)
    count = 0
    with whole:
        # The index comes first, so that a browser plays before all is loaded.
        film: Any = av.open(whole.open_path, "w", format="mp4", options={"movflags": "+faststart"})
        with film:
            film.metadata["comment"] = MADE_BY
            stream = film.add_stream(CODEC, rate=fps, options=_OPTIONS)
            stream.width, stream.height, stream.pix_fmt = width, height, _COLOURS
            for frame in frames:
                picture = av.VideoFrame.from_ndarray(frame, format="rgb24")
                # Rounded exactly: the quick conversion depends on the alignment in memory.
                coded = picture.reformat(format=_COLOURS, interpolation=_EXACT, threads=1)
                film.mux(stream.encode(coded))
                count += 1
            film.mux(stream.encode(None))
        with av.open(whole.open_path, format="mp4") as film:
            written = sum(packet.size > 0 for packet in film.demux(video=0))
        if written != count:
            raise OSError(f"{path}: {written} of {count} frames were written")


def _write_gif(
    path: Path, frames: Iterable[Picture], fps: int, width: int, height: int, sampled: Sequence[Picture]
) -> None:
    """Write frames as a GIF that repeats: one palette for all of them, so that nothing flickers."""
    turns = iter(frames)
    first = next(turns)
    colours = Image.fromarray(np.concatenate([first, *sampled])).quantize(_GIF_COLOURS)
    table = np.zeros((256, 4), dtype=np.uint8)
    listed = np.array(colours.getpalette(), dtype=np.uint8).reshape(-1, 3)
    table[:, 0], table[: len(listed), 1:] = 255, listed  # alpha first
    paper = first[0, 0]
    table[_GIF_COLOURS, 1:] = paper
    whole = WholeFile(path)
    with whole as file:
        film: Any = av.open(whole.open_path, "w", format="gif", options={"loop": "0"})
        with film:
            stream = film.add_stream("gif", rate=fps)
            stream.width, stream.height, stream.pix_fmt = width, height, "pal8"
            for frame in itertools.chain([first], turns):
                flat = Image.fromarray(frame).quantize(palette=colours, dither=Image.Dither.NONE)
                # The paper as it is: Pillow takes a colour near it.
                index = np.where((frame == paper).all(axis=-1), _GIF_COLOURS, np.asarray(flat))
                indexed: Any = index.astype(np.uint8), table
                film.mux(stream.encode(av.VideoFrame.from_ndarray(indexed, format="pal8")))
            film.mux(stream.encode(None))
        sign = MADE_BY.encode()
        file.seek(-1, os.SEEK_END)  # a comment, before the byte that ends the file
        file.write(b"!\xfe" + bytes([len(sign)]) + sign + b"\0;")
