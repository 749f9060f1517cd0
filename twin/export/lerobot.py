"""Writing episodes as a LeRobot dataset, format v3.0 (https://huggingface.co/docs/lerobot).

```
data/chunk-000/file-000.parquet           frames, one row group per episode (see `frames.frame_columns`)
meta/info.json                            frames per second, names, types and shapes of the columns, totals
meta/stats.json                           statistics of each column over the dataset (see `statistics`)
meta/tasks.parquet                        tasks in words
README.md                                 what it holds, and how pandas, PyTorch and LeRobot load it
meta/episodes/chunk-000/file-000.parquet  per episode: where its frames are, and its statistics
videos/observation.images.camera/chunk-000/file-000.mp4  pictures of each camera (see `videos`)
```

Two columns of the episodes are ours beside those of LeRobot: `source`, the name of the record, and
`metadata`, its metadata as JSON. What is one number per frame is stored as such, as LeRobot does, not as a
list of one.

A measurement that is missing is NaN in `observation.state`, and not counted in the statistics. LeRobot's
loader hands NaN on as it is; its normalisation keeps it, and so a loss that takes such a frame in is NaN:
leave those frames out, or fill them. LeRobot's loader makes float32 of the float64 columns; pandas and Arrow
do not.
"""

import io
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from twin import __version__
from twin.episode import Episode
from twin.errors import InputError
from twin.export.even import frames_per_second
from twin.export.frames import Column, frame_columns
from twin.export.parts import CHUNK_FILES, PartWriter
from twin.export.statistics import QUANTILES, RunningStatistics, exact_statistics
from twin.export.videos import VIDEO_PATH, nested, video_feature, video_key, write_episode_video
from twin.files.assets import card_environment
from twin.files.atomic import write_whole
from twin.files.shown import in_code
from twin.recording.camera import Pictures

VERSION = "v3.0"
FILE_MEGABYTES = 100
"""Parquet files are about as large as this at most, LeRobot's own size [MiB]."""
_ROWS_AT_ONCE = 100  # episodes whose description is held until it is written
_PATH = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"


def write_lerobot(
    folder: Path,
    episodes: Iterable[tuple[str, Episode, Mapping[str, Pictures]]],
    *,
    file_megabytes: float = FILE_MEGABYTES,
) -> dict[str, Any]:
    """Write a dataset; one episode at a time is in memory.

    Args:
        folder: an empty folder; under an exception, what is in it is not complete.
        episodes: a name, a record at even samples and its pictures by the name of the camera, each with the
            same columns, samples per second, cameras and size of the pictures.
        file_megabytes: where a Parquet file ends and the next one begins [MiB].

    Returns:
        The contents of `info.json`.

    Raises:
        ValueError: there is no episode, or one is not at even samples, or differs from the first one in
            columns or samples per second, or a column is known nowhere.
        OSError: the disk is full or fails.
    """
    limit = file_megabytes * 2**20
    with PartWriter(folder / "data", limit) as data, PartWriter(folder / "meta" / "episodes", limit) as meta:
        dataset = _Dataset(folder, data, meta)
        for name, episode, pictures in episodes:
            dataset.add(name, episode, pictures)
        dataset.flush()
    info = dataset.info(file_megabytes)
    write_whole(folder / "meta" / "info.json", _json(info))
    write_whole(folder / "meta" / "stats.json", _json(dataset.statistics()))
    write_whole(folder / "meta" / "tasks.parquet", _tasks(dataset.tasks))
    write_whole(folder / "README.md", _card(info))
    return info


class _Dataset:
    """Facts of the episodes written so far."""

    def __init__(self, folder: Path, data: PartWriter, meta: PartWriter) -> None:
        self.tasks: dict[str, int] = {}
        self._folder = folder
        self._data, self._meta = data, meta
        self._robots: set[str] = set()
        self._features: dict[str, dict[str, Any]] = {}
        self._running: dict[str, RunningStatistics] = {}
        self._rows: list[dict[str, Any]] = []
        self._first = ""
        self._per_second = self._episodes = self._frames = 0

    def add(self, name: str, episode: Episode, pictures: Mapping[str, Pictures]) -> None:
        try:
            per_second = frames_per_second(episode)
        except ValueError as error:
            raise InputError(f"{name}: {error}") from error
        robot, task = _robot_and_task(episode)
        columns = frame_columns(
            episode,
            per_second=per_second,
            episode_index=self._episodes,
            first_index=self._frames,
            task_index=self.tasks.setdefault(task, len(self.tasks)),
        )
        features = {key: column.feature for key, column in columns.items()}
        features |= {video_key(camera): video_feature(seen, per_second) for camera, seen in pictures.items()}
        self._check(name, per_second, features)
        self._robots.add(robot)
        count = len(episode.time)
        chunk, file = self._data.place(count)
        self._data.write(pa.table({key: column.array for key, column in columns.items()}))
        row = {
            "episode_index": self._episodes,
            "tasks": [task],
            "length": count,
            "data/chunk_index": chunk,
            "data/file_index": file,
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + count,
            "source": name,
            "metadata": json.dumps(episode.metadata, sort_keys=True, default=lambda value: value.tolist()),
        }
        for camera, seen in pictures.items():
            row |= self._add_video(name, video_key(camera), episode, seen)
        self._rows.append(row | self._statistics_of(columns))
        self._episodes += 1
        self._frames += count
        if len(self._rows) >= _ROWS_AT_ONCE:
            self.flush()

    def _add_video(self, name: str, key: str, episode: Episode, pictures: Pictures) -> dict[str, Any]:
        """Write the film of an episode; returns where it is, and its statistics."""
        try:
            place, pixels = write_episode_video(
                self._folder, key, self._episodes, episode, pictures, self._per_second
            )
        except ValueError as error:
            raise InputError(f"{name}: {error}") from error
        self._running[key].add(pixels)
        told = nested(exact_statistics(pixels))
        return place | {f"stats/{key}/{statistic}": numbers for statistic, numbers in told.items()}

    def flush(self) -> None:
        """Write the descriptions of episodes that are still held."""
        if not self._rows:
            return
        chunk, file = self._meta.place(len(self._rows))
        place = {"meta/episodes/chunk_index": chunk, "meta/episodes/file_index": file}
        self._meta.write(pa.Table.from_pylist([row | place for row in self._rows], schema=self._row_schema()))
        self._rows = []

    def info(self, file_megabytes: float) -> dict[str, Any]:
        """Return the contents of `info.json`."""
        if self._episodes == 0:
            raise InputError("there is no episode to write")
        return {
            "codebase_version": VERSION,
            "robot_type": self._robots.pop() if len(self._robots) == 1 else "endoscope",
            "total_episodes": self._episodes,
            "total_frames": self._frames,
            "total_tasks": len(self.tasks),
            "chunks_size": CHUNK_FILES,
            "data_files_size_in_mb": file_megabytes,
            "video_files_size_in_mb": 200,
            "fps": self._per_second,
            "splits": {"train": f"0:{self._episodes}"},
            "data_path": f"data/{_PATH}",
            "video_path": VIDEO_PATH if self._videos else None,
            "features": self._features,
        }

    def statistics(self) -> dict[str, Mapping[str, Any]]:
        """Return the contents of `stats.json`."""
        told: dict[str, Mapping[str, Any]] = {
            name: running.result() for name, running in self._running.items()
        }
        for name, values in told.items():
            if np.isnan(values["mean"]).any():
                missing = int(np.isnan(values["mean"]).argmax())
                raise InputError(
                    f"{self._features[name]['names'][missing]} is missing at every sample of all episodes"
                )
        return told | {key: nested(dict(told[key])) for key in self._videos}

    @property
    def _videos(self) -> list[str]:
        return [key for key, feature in self._features.items() if _is_video(feature)]

    def _check(self, name: str, per_second: int, features: dict[str, dict[str, Any]]) -> None:
        """Take the first episode as the measure of the others."""
        if self._episodes == 0:
            self._first, self._per_second, self._features = name, per_second, features
            self._running = {key: RunningStatistics(_columns(feature)) for key, feature in features.items()}
            return
        if per_second != self._per_second:
            raise InputError(
                f"{name} has {per_second} samples per second, {self._first} has {self._per_second}: "
                "give a sample time that suits both, or export them apart"
            )
        for key in [*self._features, *features]:
            first, this = (_width(of, key) for of in (self._features, features))
            if this != first:
                raise InputError(f"{name} has {this}, {self._first} has {first}: export them apart")

    def _statistics_of(self, columns: Mapping[str, Column]) -> dict[str, Any]:
        told: dict[str, Any] = {}
        for name, column in columns.items():
            values = column.values.astype(np.float64)
            self._running[name].add(values)
            told |= {f"stats/{name}/{key}": numbers for key, numbers in exact_statistics(values).items()}
        return told

    def _row_schema(self) -> pa.Schema:
        types = {
            "episode_index": pa.int64(),
            "tasks": pa.list_(pa.string()),
            "length": pa.int64(),
            "data/chunk_index": pa.int64(),
            "data/file_index": pa.int64(),
            "dataset_from_index": pa.int64(),
            "dataset_to_index": pa.int64(),
        }
        for name in self._videos:
            for key in ("chunk_index", "file_index", "from_timestamp", "to_timestamp"):
                types[f"videos/{name}/{key}"] = pa.int64() if key.endswith("index") else pa.float64()
        for name, feature in self._features.items():
            numbers = pa.list_(pa.float64())
            if _is_video(feature):
                numbers = pa.list_(pa.list_(numbers))
            for key in ("min", "max", "mean", "std", "count", *QUANTILES):
                types[f"stats/{name}/{key}"] = pa.list_(pa.int64()) if key == "count" else numbers
        types |= {"meta/episodes/chunk_index": pa.int64(), "meta/episodes/file_index": pa.int64()}
        return pa.schema(types | {"source": pa.string(), "metadata": pa.string()})


def _robot_and_task(episode: Episode) -> tuple[str, str]:
    """Return what the robot is called, and what it does in words."""
    facts = episode.metadata
    preset = facts.get("preset")
    robot = str(preset.get("name", "endoscope") if isinstance(preset, Mapping) else preset or "endoscope")
    if facts.get("source") == "measured":
        return robot, f"bend the {robot} as in the measured log"
    signal = facts.get("signal")
    return robot, f"bend the {robot} by a {signal} command" if signal else f"bend the {robot}"


def _columns(feature: Mapping[str, Any]) -> int:
    """Return how many numbers of a feature are counted apart: of a sample, or the colours of a video."""
    return 3 if _is_video(feature) else int(feature["shape"][0])


def _is_video(feature: Mapping[str, Any]) -> bool:
    return str(feature["dtype"]) == "video"


def _width(features: Mapping[str, dict[str, Any]], key: str) -> str:
    if key in features and _is_video(features[key]):
        height, width, _ = features[key]["shape"]
        return f"pictures of {width} x {height}"
    width = features[key]["shape"][0] if key in features else 0
    return f"{width} columns of {key}" if width else f"no {key}"


def _tasks(tasks: Mapping[str, int]) -> bytes:
    """Return the table of tasks; LeRobot looks them up in the index that pandas makes of the first column."""
    table = pa.table({"task": list(tasks), "task_index": pa.array(list(tasks.values()), pa.int64())})
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": stored, "metadata": None}
        for name, kind, stored in (("task", "unicode", "object"), ("task_index", "int64", "int64"))
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    file = io.BytesIO()
    pq.write_table(table.replace_schema_metadata({"pandas": json.dumps(pandas)}), file)
    return file.getvalue()


def _card(info: Mapping[str, Any]) -> str:
    """Return the README.md of the dataset: what it holds, and how to load it."""
    return (
        card_environment()
        .get_template("lerobot_card.md.j2")
        .render(
            hub_name=json.dumps(f"Hysteresis of {info['robot_type']}"),
            robot=in_code(str(info["robot_type"])),
            episodes=info["total_episodes"],
            frames=info["total_frames"],
            fps=info["fps"],
            version=VERSION,
            endotwin=__version__,
            features=info["features"],
            video=any(map(_is_video, info["features"].values())),
        )
    )


def _json(contents: Mapping[str, Any]) -> str:
    return json.dumps(contents, indent=4, allow_nan=False) + "\n"
