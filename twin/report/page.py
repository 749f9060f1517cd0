"""One self-contained HTML page about a run: what was run, what came out, and the paper beside it."""

import base64
import contextlib
import csv
import dataclasses
import functools
import io
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from matplotlib.figure import Figure
from PIL import Image
from pydantic import BaseModel, ConfigDict, Field

from twin.errors import InputError, MissingFileError
from twin.estimation.learned.policy import POLICY_FILE
from twin.estimation.registry import proposed_method
from twin.evaluation.paper import TABLES
from twin.evaluation.score import read_scores
from twin.evaluation.track import load_tracks
from twin.files.atomic import write_whole
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.json_text import read_json
from twin.files.shown import cut
from twin.hysteresis import ColemanHodgdon, HysteresisModel, load_model
from twin.recording import read_dataset
from twin.rendering.video import read_frames
from twin.report.facts import MOST_TEXT, agent_names, run_facts
from twin.report.figures import loop_figure, rmse_figure, to_svg, training_figure
from twin.report.findings import all_findings
from twin.report.paper_figures import paper_figures
from twin.report.tables import paper_table, table_title
from twin.report.template import page_environment

Value = TypeVar("Value")

LARGEST_VIDEO = 8 * 2**20
"""A film above this size [bytes] is shown as a strip of frames: pages of tens of megabytes open slowly."""

LARGEST_PICTURE = 16 * MEBIBYTE
LARGEST_FILM = 512 * MEBIBYTE
"""Sizes that are read of pictures and films [bytes]."""

_PNG, _MP4 = b"\x89PNG\r\n\x1a\n", b"ftyp"
"""First bytes of the two kinds of file; those of MP4 follow the length of its first part."""

_DRAWN = 2
"""Loops that are drawn over each other: more cannot be told apart."""


@functools.cache
def _commands() -> dict[str, str]:
    """Command that makes each part of a run folder."""
    agent = proposed_method().agent
    learn = f"train data/train --model coleman_hodgdon.json --agent {agent} --protocol strict"
    evaluate = (
        "evaluate data/test --train data/train --model coleman_hodgdon.json "
        f"--policy runs/{agent}/{POLICY_FILE} --suite paper --seeds 20 --out results"
    )
    generate = "generate --preset ureteroscope --seconds 60"
    return {
        "data/train": f"{generate} --stroke 2 4 --episodes 4 --seed 1 --out data/train",
        "data/test": f"{generate} --stroke -1 1 --episodes 2 --seed 2 --out data/test",
        "coleman_hodgdon.json": "identify data/train --out coleman_hodgdon.json",
        "runs": f"{learn} --out runs/{agent}",
        "results/evaluation.json": evaluate,
        "bend.mp4": "render data/test --out bend.mp4",
        "bend.png": "render data/test --out bend.png",
        "results/tracks.npz": evaluate,
    }


class DemoFile(BaseModel):
    """Contents of `demo.json`, as far as the page needs them.

    Attributes:
        commands: that made the run.
    """

    model_config = ConfigDict(frozen=True, strict=True)

    commands: Annotated[list[Annotated[str, Field(max_length=2000)]], Field(max_length=100)]


@dataclasses.dataclass(frozen=True)
class Shown:
    """A picture of the page, or a film.

    Attributes:
        source: A `data:` address.
        caption: below it.
        is_film: whether it is a film, not a picture.
    """

    source: str
    caption: str
    is_film: bool = False


@dataclasses.dataclass(frozen=True)
class Gap:
    """Something that the run folder does not hold, and the command that makes it.

    Attributes:
        sentence: names it.
        command: makes it.
    """

    sentence: str
    command: str


def write_report(folder: Path, path: Path) -> Path:
    """Write the report of a run folder; what the folder lacks is named with the command that makes it.

    Args:
        folder: of a run, such as `make demo` leaves in `out/demo`.
        path: the HTML file to write, whole or not at all.

    Returns:
        `path`.

    Raises:
        FileNotFoundError: there is no such folder, or none to write into.
        ValueError: nothing in the folder belongs to a run.
    """
    if not folder.is_dir():
        raise MissingFileError(f"no folder {folder}")
    if not any((folder / name).exists() for name in _commands()):
        raise InputError(f"{folder} holds no run: expected one of {', '.join(_commands())}")
    environment = page_environment()
    environment.tests["gap"] = lambda part: isinstance(part, Gap)
    page = environment.get_template("report.html.j2").render(_contents(folder))
    write_whole(path, page)
    return path


def _contents(folder: Path) -> dict[str, Any]:
    """Everything that the template shows, each part in full or as a `Gap`."""
    evaluation = _part(folder, "results/evaluation.json", _evaluation)
    model = _part(folder, "coleman_hodgdon.json", _coleman_hodgdon)
    fit = None if isinstance(model, Gap) else model
    return {
        "results": evaluation,
        "model": model,
        "facts": run_facts(folder),
        "bending": [_part(folder, "bend.png", _poses), _part(folder, "bend.mp4", _film)],
        "loops": [_part(folder, f"data/{name}", lambda path: _loop(path, fit)) for name in ("train", "test")],
        "tracking": _part(folder, "results/tracks.npz", _tracking),
        "training": _part(folder, "runs", _training),
        "commands": _commands_run(folder),
    }


def _commands_run(folder: Path) -> list[str]:
    """The commands that made this run, where it says them; else those that make such a run."""
    with contextlib.suppress(OSError, ValueError):
        return DemoFile.model_validate(read_json(folder / "demo.json", MOST_TEXT)).commands
    return list(dict.fromkeys(f"endotwin {command}" for command in _commands().values()))


def _part(folder: Path, name: str, read: Callable[[Path], Value]) -> Value | Gap:
    """Part of the page that `read` makes of a file or folder of the run, or why it is not there."""
    command = f"endotwin {_commands()[name]}"
    if not (folder / name).exists():
        return Gap(f"This run has no {name}.", command)
    try:
        return read(folder / name)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, ArithmeticError) as error:
        reason = cut(str(error).replace(f"{folder}/", ""), 300)
        return Gap(f"{name} cannot be shown: {reason or type(error).__name__}.", command)


def _coleman_hodgdon(path: Path) -> ColemanHodgdon:
    model = load_model(path)
    if not isinstance(model, ColemanHodgdon):
        raise InputError(f"it holds the model {model.name!r}, the page shows that of Coleman and Hodgdon")
    return model


def _evaluation(path: Path) -> dict[str, Any]:
    scores, _ = read_scores(path)
    tables = [(table_title(table), paper_table(scores, table.noise, "html")) for table in TABLES]
    caption = (
        "RMSE against the clean truth, with the 95 % interval of its mean over noise seeds; "
        "hollow marks are the paper's, measured on another endoscope."
    )
    return {
        "findings": all_findings(scores),
        "tables": [(title, body) for title, body in tables if body],
        "rmse": _drawn(rmse_figure(scores), caption),
    }


def _poses(path: Path) -> Shown:
    caption = (
        "Poses along one record, and where they lie on its hysteresis loop. Poses 2 and 3 have the same pull "
        "on the wires: how far the tip bends depends on where it came from."
    )
    content = read_limited(path, LARGEST_PICTURE)
    if not content.startswith(_PNG):
        raise InputError("it is no PNG picture")
    return Shown(_address("image/png", content), caption)


def _film(path: Path) -> Shown:
    caption = "The record replayed, and its loop as it is drawn."
    content = read_limited(path, LARGEST_FILM)
    if content[4:8] != _MP4:
        raise InputError("it is no MP4 film")
    if len(content) < LARGEST_VIDEO:
        return Shown(_address("video/mp4", content), caption, is_film=True)
    frames = read_frames(path, 6)
    small = [Image.fromarray(frame[:, : frame.shape[1] // 2]).resize((320, 360)) for frame in frames]
    strip = io.BytesIO()
    Image.fromarray(np.concatenate([np.asarray(frame) for frame in small], axis=1)).save(strip, "PNG")
    return Shown(_address("image/png", strip.getvalue()), f"Six moments of {path.name}, left to right.")


def _loop(path: Path, model: HysteresisModel | None) -> Shown:
    episodes = read_dataset(path)
    loops = [(episode.pull_mm, episode.bend_deg) for episode in episodes]
    fits = [] if model is None else [model.response(pull, bend[0]) for pull, bend in loops]
    caption = f"The first {min(_DRAWN, len(loops))} of {len(loops)} records of {path.parent.name}/{path.name}"
    if model is not None:
        error = np.concatenate([fit - bend for (_, bend), fit in zip(loops, fits, strict=True)])
        caption += f", and the identified model. Over all: RMSE {np.sqrt(np.mean(error**2)):.2f} deg"
    return _drawn(loop_figure(loops[:_DRAWN], fits[:_DRAWN]), f"{caption}.")


def _tracking(path: Path) -> list[Shown]:
    evaluation = path.with_name("evaluation.json")
    scores = read_scores(evaluation)[0] if evaluation.is_file() else []
    shown = [_drawn(*drawn) for drawn in paper_figures(load_tracks(path), scores).values()]
    if not shown:
        raise InputError("it has none of the noises and methods of the paper's figures")
    return shown


def _training(path: Path) -> Shown:
    curves = {}
    for folder, agent in agent_names().items():
        progress = path / folder / "progress.csv"
        if progress.is_file():
            curves[agent] = _progress(progress)
    if not curves:
        raise InputError("no agent in it has a progress.csv")
    caption = "What each agent pays per step while it learns, thin as recorded, thick the running median."
    return _drawn(training_figure(curves), caption)


def _progress(path: Path) -> dict[str, Any]:
    """Return samples and returns of a training, as its `progress.csv` lists them."""
    try:
        text = read_limited(path, MOST_TEXT).decode()
        lines = list(csv.DictReader(io.StringIO(text)))
        curve = {
            key: np.array([float(line[name]) for line in lines])
            for key, name in (("samples", "samples"), ("return", "mean_reward"))
        }
    except (csv.Error, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path.parent.name}/{path.name}: {cut(error) or 'a column is missing'}") from error
    if not lines or not np.isfinite(curve["samples"]).all():
        raise InputError(f"{path.parent.name}/{path.name} has no lines of numbers")
    return curve


def _drawn(figure: Figure, caption: str) -> Shown:
    return Shown(_address("image/svg+xml", to_svg(figure).encode()), caption)


def _address(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
