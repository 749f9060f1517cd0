"""Columns of a LeRobot dataset: numbers and pictures of an episode, their features and statistics."""

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from twin.episode import Episode
from twin.errors import InputError
from twin.recording.camera import Pictures
from twin.recording.features import FEATURES, column_names, recorded
from twin.rendering.video import write_video

Array = NDArray[np.float64]

OBSERVED = ("/measurement", "/tension")  # topics of the columns of `observation.state`
COMMANDED = ("/command",)  # topics of the columns of `action`
TRUE = "truth."  # prefix of the names of labels and hidden states: the quantities of every other topic
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
EVEN = 0.01  # share of the sample time by which a sample may be off its place
SAMPLED = 20  # pictures of an episode that its statistics are of, at most
_APART = 4  # pixels in either direction between those that are counted
_ROUND = [digit * 10**power for power in range(4) for digit in (1, 2, 5)]  # samples per second to propose


def frames_per_second(episode: Episode) -> int:
    """Return how many samples a second has: LeRobot keeps an integer, and places samples by it alone."""
    per_second = round(1 / episode.sample_time)
    seconds = episode.time - episode.time[0]
    if per_second >= 1 and np.abs(seconds * per_second - np.arange(len(seconds))).max() <= EVEN:
        return per_second
    steps = np.diff(episode.time)
    apart = f"{steps.min():.6g} s"
    if np.ptp(steps) > EVEN * steps.min():
        apart += f" to {steps.max():.6g} s"
    near = min(_ROUND, key=lambda rate: abs(np.log(rate * episode.sample_time)))
    raise InputError(
        f"its samples are {apart} apart: must be evenly apart, a whole number per second; "
        f"give a sample time, such as {1 / near:g} s, or choose another format"
    )


@dataclasses.dataclass(frozen=True)
class Column:
    """One feature of a LeRobot dataset."""

    values: NDArray[Any]  # (N, numbers), in the type that is stored
    names: tuple[str, ...] | None  # name of each number; None where it needs none

    @property
    def feature(self) -> dict[str, Any]:
        """Its entry in `info.json`: type, shape, names."""
        return {
            "dtype": str(self.values.dtype),
            "shape": [self.values.shape[1]],
            "names": None if self.names is None else list(self.names),
        }

    @property
    def array(self) -> pa.Array:
        """As stored: numbers where there is one per frame, else lists of a fixed length. NaN stays NaN."""
        flat = pa.array(self.values.ravel(), from_pandas=False)
        numbers = self.values.shape[1]
        return flat if numbers == 1 else pa.FixedSizeListArray.from_arrays(flat, numbers)


def frame_columns(
    episode: Episode, *, per_second: int, episode_index: int, first_index: int, task_index: int
) -> dict[str, Column]:
    """Return all columns of an episode at even samples by name, in the order of the dataset.

    What policies read and write, `observation.state` and `action`, is float32, as they expect it. Labels and
    hidden states are float64, as they are in the episode.
    """
    held = recorded(episode)
    count = len(episode.time)
    observed, commanded, true = [], [], {}
    for feature in FEATURES:
        if feature.name in held:
            values = held[feature.name].reshape(count, -1).astype(np.float64)
            column = Column(values, column_names(feature, held[feature.name].shape[1:]))
            if feature.topic in OBSERVED:
                observed.append(column)
            elif feature.topic in COMMANDED:
                commanded.append(column)
            else:
                true[TRUE + feature.column] = column
    columns = {"observation.state": _joined(observed), "action": _joined(commanded), **true}
    frame = np.arange(count)
    columns["timestamp"] = Column((frame / per_second).astype(np.float32)[:, None], None)
    for name, numbers in {
        "frame_index": frame,
        "episode_index": np.full(count, episode_index),
        "index": first_index + frame,
        "task_index": np.full(count, task_index),
    }.items():
        columns[name] = Column(numbers.astype(np.int64)[:, None], None)
    return columns


def _joined(columns: list[Column]) -> Column:
    values = np.hstack([column.values for column in columns]).astype(np.float32)
    return Column(values, tuple(name for column in columns for name in column.names or ()))


def statistics(values: NDArray[Any]) -> dict[str, list[float]]:
    """Return `min`, `max`, `mean`, `std` and `QUANTILES` of each column of (N, columns), and `count`.

    NaN is not counted; where a column has nothing else, its statistics are NaN. `count` is one number: the
    rows without NaN.
    """
    values = values.astype(np.float64)
    columns = [column[~np.isnan(column)] for column in values.T]
    known = [column if len(column) else np.array([np.nan]) for column in columns]
    figures = {
        name: [float(getattr(np, name)(one)) for one in known] for name in ("min", "max", "mean", "std")
    }
    quantiles = np.array([np.quantile(column, list(QUANTILES.values())) for column in known]).T
    count = [int((~np.isnan(values)).all(axis=1).sum())]
    return {**figures, "count": count, **dict(zip(QUANTILES, quantiles.tolist(), strict=True))}


def video_key(camera: str) -> str:
    """Return the column of the pictures of a camera."""
    return f"observation.images.{camera}"


def video_feature(pictures: Pictures, per_second: int) -> dict[str, Any]:
    """Return the entry of the video in `info.json`."""
    width, height = _even_size(pictures)
    return {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channels"],
        "info": {
            "video.height": height,
            "video.width": width,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": per_second,
            "video.channels": 3,
            "has_audio": False,
        },
    }


def write_episode_video(
    path: Path, episode: Episode, pictures: Pictures, per_second: int
) -> NDArray[np.uint8]:
    """Write the film of an episode, a picture for each of its samples; returns (pixels, 3), some of them.

    A frame that has no picture of its own shows the latest one, as LeRobot finds a picture by the time of its
    frame; where pictures are rarer than samples, `sample_time` thins the samples to their rate.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    width, height = _even_size(pictures)
    count = len(episode.time)
    counted = set(np.linspace(0, count - 1, min(count, SAMPLED)).astype(int).tolist())
    pixels: list[NDArray[np.uint8]] = []

    def frames() -> Iterator[NDArray[np.uint8]]:
        for k, picture in enumerate(pictures.at(episode.time)):
            cut = picture[:height, :width]
            if k in counted:
                pixels.append(cut[::_APART, ::_APART].reshape(-1, 3))
            yield cut

    write_video(path, frames(), per_second, width, height)
    return np.concatenate(pixels)


def colour_statistics(counts: NDArray[np.int64]) -> dict[str, Any]:
    """Return statistics of three colours in [0, 1], in LeRobot's shape (3, 1, 1), from (256, 3) counts."""
    levels = np.arange(256)[:, None] / 255
    total = counts[:, 0].sum()
    mean = (counts * levels).sum(axis=0) / total
    until = np.cumsum(counts, axis=0)

    def numbers(rank: float) -> Array:
        """Return the numbers of a rank from 0 on, linear between two as NumPy's quantiles are."""
        low, high = (np.argmax(until > rounded(rank), axis=0) / 255 for rounded in (np.floor, np.ceil))
        between: Array = low + (rank - np.floor(rank)) * (high - low)
        return between

    figures: Mapping[str, Array] = {
        "min": numbers(0),
        "max": numbers(total - 1),
        "mean": mean,
        "std": np.sqrt((counts * (levels - mean) ** 2).sum(axis=0) / total),
        **{name: numbers(share * (total - 1)) for name, share in QUANTILES.items()},
    }
    shaped = {name: values.reshape(3, 1, 1).tolist() for name, values in figures.items()}
    return shaped | {"count": [int(total)]}


def _even_size(pictures: Pictures) -> tuple[int, int]:
    """Return width and height without an odd column or row, which no film of this kind can have."""
    width, height = pictures.size
    return width - width % 2, height - height % 2
