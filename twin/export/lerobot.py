"""Writing episodes as a LeRobot dataset, format v3.0 (https://huggingface.co/docs/lerobot).

```
data/chunk-000/file-000.parquet           frames, one row group per episode (see `columns.frame_columns`)
meta/info.json                            frames per second, names, types and shapes of the columns, totals
meta/stats.json                           statistics of each column over the dataset
meta/tasks.parquet                        tasks in words
README.md                                 what it holds, and how pandas, PyTorch and LeRobot load it
meta/episodes/chunk-000/file-000.parquet  per episode: where its frames are, and its statistics
videos/observation.images.camera/chunk-000/file-000.mp4  pictures of each camera, a film per episode
```

Three columns of the episodes are ours: `source`, the name of the record; `begin_s`, the time in the record at
which the episode begins; and `metadata` of the record, as JSON. A record longer than `LONGEST` is several
episodes. One number per frame is stored as such, as LeRobot does, not as a list of one.

A measurement that is missing is NaN in `observation.state`, and not counted in the statistics. LeRobot's
loader and its normalisation keep NaN, and so a loss over such a frame is NaN: leave those frames out, or fill
them. LeRobot's loader makes float32 of the float64 columns; pandas and Arrow do not.
"""

import contextlib
import io
import itertools
import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from twin import __version__
from twin.episode import Episode
from twin.errors import InputError
from twin.export.columns import (
    QUANTILES,
    VIDEO_PATH,
    Column,
    colour_statistics,
    frame_columns,
    frames_per_second,
    statistics,
    video_feature,
    video_key,
    write_episode_video,
)
from twin.files.assets import card_environment
from twin.files.atomic import WholeFile, write_whole
from twin.files.shown import in_code
from twin.recording.camera import Pictures

VERSION = "v3.0"
FILE = "chunk-000/file-000.parquet"  # frames, and descriptions of episodes, are in one file each
CHUNK_FILES = 1000  # films in one `chunk-...` folder
LONGEST = 1000.0
"""Length of an episode, at most [s]: from 1024 s on, the steps between time stamps, which are float32, err by
more than the 1e-4 s that LeRobot tolerates."""


def write_lerobot(
    folder: Path, episodes: Iterable[tuple[str, Episode, Mapping[str, Pictures]]]
) -> dict[str, Any]:
    """Write a dataset; one episode at a time is in memory, and then one column for its statistics.

    Returns:
        The contents of `info.json`.
    """
    dataset = _Dataset(folder)
    with WholeFile(_made(folder / "data" / FILE)) as file, contextlib.ExitStack() as stack:
        for name, record, pictures in episodes:
            for episode in _parts(record):
                columns = dataset.add(name, episode, pictures)
                table = pa.table({key: column.array for key, column in columns.items()})
                if dataset.episodes == 1:
                    writer = stack.enter_context(pq.ParquetWriter(file, table.schema, compression="zstd"))
                writer.write_table(table, row_group_size=max(len(table), 1))
    info = dataset.info()
    rows = pa.Table.from_pylist(dataset.rows, schema=dataset.row_schema())
    with WholeFile(_made(folder / "meta" / "episodes" / FILE)) as file:
        pq.write_table(rows, file, compression="zstd")
    write_whole(folder / "meta" / "info.json", _json(info))
    write_whole(folder / "meta" / "stats.json", _json(dataset.statistics()))
    write_whole(folder / "meta" / "tasks.parquet", _tasks(dataset.tasks))
    write_whole(folder / "README.md", _card(info))
    return info


def _parts(record: Episode) -> list[Episode]:
    """Return a record in parts of nearly equal length, none longer than `LONGEST`."""
    most = LONGEST * max(round(1 / record.sample_time), 1)
    edges = np.linspace(0, len(record.time), math.ceil(len(record.time) / most) + 1).astype(int).tolist()
    return [record.part(*ends) for ends in itertools.pairwise(edges)]


def _made(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


class _Dataset:
    def __init__(self, folder: Path) -> None:
        self.tasks: dict[str, int] = {}
        self.rows: list[dict[str, Any]] = []
        self.episodes = 0
        self._folder = folder
        self._robots: set[str] = set()
        self._features: dict[str, dict[str, Any]] = {}
        self._colours: dict[str, NDArray[np.int64]] = {}  # (256, 3) counts of each video
        self._first = ""
        self._per_second = self._frames = 0

    def add(self, name: str, episode: Episode, pictures: Mapping[str, Pictures]) -> dict[str, Column]:
        """Describe an episode and write its films; returns its columns."""
        robot, task = _robot_and_task(episode)
        count = len(episode.time)
        try:
            per_second = frames_per_second(episode)
        except ValueError as error:
            raise InputError(f"{name}: {error}") from error
        columns = frame_columns(
            episode,
            per_second=per_second,
            episode_index=self.episodes,
            first_index=self._frames,
            task_index=self.tasks.setdefault(task, len(self.tasks)),
        )
        features = {key: column.feature for key, column in columns.items()}
        features |= {video_key(camera): video_feature(seen, per_second) for camera, seen in pictures.items()}
        self._check(name, per_second, features)
        self._robots.add(robot)
        row = {
            "episode_index": self.episodes,
            "tasks": [task],
            "length": count,
            "data/chunk_index": 0,
            "data/file_index": 0,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + count,
            "source": name,
            "begin_s": float(episode.time[0]),
            "metadata": json.dumps(episode.metadata, sort_keys=True, default=lambda value: value.tolist()),
        }
        for camera, seen in pictures.items():
            row |= self._add_video(name, video_key(camera), episode, seen)
        for key, column in columns.items():
            row |= {f"stats/{key}/{name}": figures for name, figures in statistics(column.values).items()}
        self.rows.append(row)
        self.episodes += 1
        self._frames += count
        return columns

    def _add_video(self, name: str, key: str, episode: Episode, pictures: Pictures) -> dict[str, Any]:
        chunk, file = divmod(self.episodes, CHUNK_FILES)
        path = self._folder / VIDEO_PATH.format(video_key=key, chunk_index=chunk, file_index=file)
        try:
            pixels = write_episode_video(path, episode, pictures, self._per_second)
        except ValueError as error:
            raise InputError(f"{name}: {error}") from error
        counts = np.stack([np.bincount(colour, minlength=256) for colour in pixels.T], axis=1)
        self._colours[key] += counts
        place = {
            f"videos/{key}/chunk_index": chunk,
            f"videos/{key}/file_index": file,
            f"videos/{key}/from_timestamp": 0.0,
            f"videos/{key}/to_timestamp": len(episode.time) / self._per_second,
        }
        figures = colour_statistics(counts)
        return place | {f"stats/{key}/{statistic}": numbers for statistic, numbers in figures.items()}

    def info(self) -> dict[str, Any]:
        """Return the contents of `info.json`."""
        if self.episodes == 0:
            raise InputError("there is no episode to write")
        return {
            "codebase_version": VERSION,
            "robot_type": self._robots.pop() if len(self._robots) == 1 else "endoscope",
            "total_episodes": self.episodes,
            "total_frames": self._frames,
            "total_tasks": len(self.tasks),
            "chunks_size": CHUNK_FILES,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self._per_second,
            "splits": {"train": f"0:{self.episodes}"},
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": VIDEO_PATH if self._colours else None,
            "features": self._features,
        }

    def statistics(self) -> dict[str, Any]:
        """Return the contents of `stats.json`: of the columns of the data files, and of the videos."""
        found: dict[str, Any] = {}
        for name, feature in self._features.items():
            if name in self._colours:
                found[name] = colour_statistics(self._colours[name])
                continue
            held = pq.read_table(self._folder / "data", columns=[name])[name].combine_chunks()
            flat = held.flatten() if pa.types.is_fixed_size_list(held.type) else held
            found[name] = statistics(flat.to_numpy(zero_copy_only=False).reshape(-1, *feature["shape"]))
            unknown = np.isnan(found[name]["mean"])
            if unknown.any():
                missing = feature["names"][int(unknown.argmax())]
                raise InputError(f"{missing} is missing at every sample of all episodes")
        return found

    def _check(self, name: str, per_second: int, features: dict[str, dict[str, Any]]) -> None:
        """Take the first episode as the measure of the others."""
        if self.episodes == 0:
            self._first, self._per_second, self._features = name, per_second, features
            videos = (key for key, feature in features.items() if _is_video(feature))
            self._colours = {key: np.zeros((256, 3), dtype=np.int64) for key in videos}
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

    def row_schema(self) -> pa.Schema:
        types = {
            "episode_index": pa.int64(),
            "tasks": pa.list_(pa.string()),
            "length": pa.int64(),
            "data/chunk_index": pa.int64(),
            "data/file_index": pa.int64(),
            "dataset_from_index": pa.int64(),
            "dataset_to_index": pa.int64(),
        }
        for name in self._colours:
            for key in ("chunk_index", "file_index", "from_timestamp", "to_timestamp"):
                types[f"videos/{name}/{key}"] = pa.int64() if key.endswith("index") else pa.float64()
        for name in self._features:
            numbers = pa.list_(pa.float64())
            if name in self._colours:
                numbers = pa.list_(pa.list_(numbers))
            for key in ("min", "max", "mean", "std", "count", *QUANTILES):
                types[f"stats/{name}/{key}"] = pa.list_(pa.int64()) if key == "count" else numbers
        types |= {"meta/episodes/chunk_index": pa.int64(), "meta/episodes/file_index": pa.int64()}
        return pa.schema(types | {"source": pa.string(), "begin_s": pa.float64(), "metadata": pa.string()})


def _robot_and_task(episode: Episode) -> tuple[str, str]:
    robot = episode.preset_name or "endoscope"
    if episode.is_measured:
        return robot, f"bend the {robot} as in the measured log"
    signal = episode.metadata.get("signal")
    return robot, f"bend the {robot} by a {signal} command" if signal else f"bend the {robot}"


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
