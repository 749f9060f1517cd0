"""The page of a whole run: its records, its model, its trainings, and every method beside the paper's."""

import contextlib
import functools
import io
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
from markupsafe import Markup
from PIL import Image
from pydantic import BaseModel, ConfigDict, Field

from twin.episode import Episode
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.learned.policy import POLICY_FILE
from twin.estimation.registry import proposed_method
from twin.evaluation.score import read_scores
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.json_text import read_json
from twin.files.progress_csv import read_progress
from twin.files.shown import cut
from twin.hysteresis import ColemanHodgdon, HysteresisModel, load_model
from twin.preset.file import preset_of
from twin.recording import read_dataset
from twin.rendering.video import read_frames
from twin.report.evaluation_parts import result_parts, tracking_parts
from twin.report.facts import MOST_TEXT, agent_names, run_facts
from twin.report.figures import loop_figure, training_figure
from twin.report.headline import evaluation_headline
from twin.report.parts import (
    MP4,
    Facts,
    Gap,
    Page,
    Part,
    Picture,
    Section,
    SideBySide,
    Text,
    data_address,
    drawn,
    png_picture,
    repeat_section,
)
from twin.report.player import record_player
from twin.report.schematics import bending_schematic, direct_schematic, platform_schematic, ram_schematic

Value = TypeVar("Value")

LARGEST_VIDEO = 8 * 2**20
"""A film above this size [bytes] is shown as a strip of frames: pages of tens of megabytes open slowly."""
LARGEST_FILM = 512 * MEBIBYTE
"""Size that is read of a film [bytes]."""

MINUS = "\N{MINUS SIGN}"
_DRAWN = 2
"""Loops that are drawn over each other: more cannot be told apart."""


@functools.cache
def run_commands() -> dict[str, str]:
    """Return the command that makes each part of a run folder."""
    agent = proposed_method().agent
    learn = f"train data/train --model coleman_hodgdon.json --agent {agent} --protocol strict"
    evaluate = (
        "evaluate data/test --train data/train --model coleman_hodgdon.json "
        f"--policy runs/{agent}/{POLICY_FILE} --suite paper --seeds 20 --out results"
    )
    generate = "generate --preset ureteroscope"
    return {
        "data/train": f"{generate} --stroke 2 4 --episodes 4 --seconds 60 --seed 1 --out data/train",
        "data/test": f"{generate} --stroke -1 1 --episodes 4 --seconds 60 --seed 2 --out data/test",
        "coleman_hodgdon.json": "identify data/train --out coleman_hodgdon.json",
        "runs": f"{learn} --episodes 2000 --out runs/{agent}",
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


def run_page(folder: Path) -> Page:
    """Return the page of a run folder; what it lacks is named with the command that makes it."""
    evaluation = _part(folder, "results/evaluation.json", lambda path: read_scores(path)[0])
    model = _part(folder, "coleman_hodgdon.json", _coleman_hodgdon)
    fit = None if isinstance(model, Gap) else model
    train = _part(folder, "data/train", read_dataset)
    test = _part(folder, "data/test", read_dataset)
    if isinstance(evaluation, Gap):
        headline = "This run has not been evaluated yet."
        results: tuple[Part, ...] = (evaluation,)
    else:
        headline = evaluation_headline(evaluation)
        results = _whole(folder, "results/evaluation.json", lambda _: result_parts(evaluation))
    facts = run_facts(folder)
    sections = (
        Section("The bending", (*_endoscope(train), *_moving(folder, test))),
        Section(
            "The loop, and the Coleman-Hodgdon model", (_equation(model), _loops(folder, train, test, fit))
        ),
        Section("How RAM works", _schemes(fit)),
        Section("Results, beside the paper's", results),
        Section("Tracking", _whole(folder, "results/tracks.npz", tracking_parts)),
        Section("Training", (_part(folder, "runs", _training),)),
        Section("What was run", (_facts(facts),)),
        repeat_section(_commands_run(folder), "`make demo` runs all of it. Step by step:"),
    )
    return Page(
        verb="report",
        kicker="EndoTwin: a digital twin of a tendon-driven flexible endoscope",
        title="Hysteresis, and how well it is estimated",
        headline=headline,
        sections=sections,
    )


def _facts(facts: list[tuple[str, list[tuple[str, str]]]]) -> Part:
    if not facts:
        return Gap("No file of this run says how it was made.")
    return Facts(tuple((title, tuple(entries)) for title, entries in facts))


def _commands_run(folder: Path) -> list[str]:
    """The commands that made this run, where it says them; else those that make such a run."""
    with contextlib.suppress(OSError, ValueError):
        return DemoFile.model_validate(read_json(folder / "demo.json", MOST_TEXT)).commands
    made = list(dict.fromkeys(f"endotwin {command}" for command in run_commands().values()))
    return [*made, "endotwin report . --out report.html"]


def _part(folder: Path, name: str, read: Callable[[Path], Value]) -> Value | Gap:
    """Part of the page that `read` makes of a file or folder of the run, or why it is not there."""
    command = f"endotwin {run_commands()[name]}"
    if not (folder / name).exists():
        return Gap(f"This run has no {name}.", command)
    try:
        return read(folder / name)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, ArithmeticError) as error:
        reason = cut(str(error).replace(f"{folder}/", ""), 300)
        return Gap(f"{name} cannot be shown: {reason or type(error).__name__}.", command)


def _whole(folder: Path, name: str, read: Callable[[Path], tuple[Part, ...]]) -> tuple[Part, ...]:
    """Parts that `read` makes, or the one that says why they are not there."""
    parts = _part(folder, name, read)
    return (parts,) if isinstance(parts, Gap) else parts


def _endoscope(train: list[Episode] | Gap) -> tuple[Part, ...]:
    """The endoscope and its platform, as the paper's Figs. 1 and 3, where a record says what it is of."""
    if isinstance(train, Gap) or not train[0].joint_angle.size:
        return ()
    parameters = train[0].metadata.get("preset")
    if not isinstance(parameters, dict):
        return ()
    preset = preset_of(str(parameters.get("name", "")), {k: v for k, v in parameters.items() if k != "name"})
    return (
        drawn(
            bending_schematic(preset, train[0]),
            "As the paper's Fig. 1: the endoscope straight, and at the largest bend of the first training "
            "record. Drawn to scale from the twin's own hinges.",
        ),
        drawn(
            platform_schematic(preset, train[0].sample_time),
            "As the paper's Fig. 3: the platform, here simulated. Between the command and the angle lie the "
            "backlash of the gear and the friction of the sheath: both make hysteresis.",
        ),
    )


def _moving(folder: Path, test: list[Episode] | Gap) -> tuple[Part, ...]:
    parts: list[Part] = [_part(folder, "bend.png", _poses), _part(folder, "bend.mp4", _film)]
    if not isinstance(test, Gap):
        parts.insert(0, record_player(test[0], "First test record"))
    return tuple(parts)


def _coleman_hodgdon(path: Path) -> ColemanHodgdon:
    model = load_model(path)
    if not isinstance(model, ColemanHodgdon):
        raise InputError(f"it holds the model {model.name!r}, the page shows that of Coleman and Hodgdon")
    return model


def _equation(model: ColemanHodgdon | Gap) -> Part:
    """The identified model, as a sentence with its equation."""
    if isinstance(model, Gap):
        return model
    a, b, c = (
        f"{float(np.asarray(of)):.4g}" for of in (model.a_per_mm, model.b_deg_per_mm, model.c_deg_per_mm)
    )
    if model.monotone():
        shape = Markup("It has <i>c</i> ≥ <i>b</i> / 2, so its loops of every size rise with the pull.")
    else:
        ratio = float(np.divide(model.c_deg_per_mm, model.b_deg_per_mm))
        shape = Markup(
            f'It has <span class="formula"><i>c</i> / <i>b</i> = {ratio:.2f}</span>, below 1/2, so its large '
            "loops do not rise with the pull everywhere."
        )
    equation = f"dθ/dt = <i>a</i> |<i>v</i>| (<i>b</i> δ<i>l</i> {MINUS} θ) + <i>c v</i>"
    spans = "".join(
        f'<span class="formula"><i>{name}</i> = {value}</span>{then}'
        for name, value, then in (
            ("a", f"{a} / mm", ", "),
            ("b", f"{b} deg / mm", " and "),
            ("c", f"{c} deg / mm", ". "),
        )
    )
    return Text(
        Markup(
            f'The identified model is <span class="formula">{equation}</span>, with δ<i>l</i> the pull and '
            f"<i>v</i> its speed; {spans}"
        )
        + shape
    )


def _schemes(model: ColemanHodgdon | None) -> tuple[Part, ...]:
    """The structures of RAM and of direct RL, as the paper's Figs. 2 and 4."""
    filter_ = {"Q": "diag(" + ", ".join(f"{q:g}" for q in ActiveModel.process_variance) + ")"}
    direct = drawn(
        direct_schematic(),
        "As the paper's Fig. 4: direct RL. The policy takes the place of model and filter, and has no "
        "physics to hold on to.",
    )
    if model is None:
        return (Gap("Without the identified model, the structure of RAM is not drawn."), direct)
    ram = drawn(
        ram_schematic(model, filter_),
        "As the paper's Fig. 2: RAM. A Kalman filter predicts by the identified model and corrects itself by "
        "the measurement; the policy says how much of the residual that is left is believed as well.",
    )
    return (ram, direct)


def _poses(path: Path) -> Picture:
    return png_picture(
        path,
        "Poses along one record, and where they lie on its hysteresis loop. Poses 2 and 3 have the same pull "
        "on the wires: how far the tip bends depends on where it came from.",
    )


def _film(path: Path) -> Picture:
    caption = "The record replayed, and its loop as it is drawn."
    content = read_limited(path, LARGEST_FILM)
    if content[4:8] != MP4:
        raise InputError("it is no MP4 film")
    if len(content) < LARGEST_VIDEO:
        return Picture(data_address("video/mp4", content), caption, is_film=True)
    frames = read_frames(path, 6)
    small = [Image.fromarray(frame[:, : frame.shape[1] // 2]).resize((320, 360)) for frame in frames]
    strip = io.BytesIO()
    Image.fromarray(np.concatenate([np.asarray(frame) for frame in small], axis=1)).save(strip, "PNG")
    return Picture(data_address("image/png", strip.getvalue()), f"Six moments of {path.name}, left to right.")


def _loops(
    folder: Path, train: list[Episode] | Gap, test: list[Episode] | Gap, fit: HysteresisModel | None
) -> Part:
    shown = []
    for name, episodes in (("data/train", train), ("data/test", test)):
        shown.append(
            episodes
            if isinstance(episodes, Gap)
            else _part(folder, name, lambda path, these=episodes: _loop(path, these, fit))  # type: ignore[misc]
        )
    return SideBySide(tuple(shown))


def _loop(path: Path, episodes: list[Episode], model: HysteresisModel | None) -> Picture:
    loops = [(episode.pull_mm, episode.truth_deg) for episode in episodes]
    fits = [] if model is None else [model.response(pull, bend[0]) for pull, bend in loops]
    caption = f"The first {min(_DRAWN, len(loops))} of {len(loops)} records of {path.parent.name}/{path.name}"
    if model is not None:
        error = np.concatenate([fit - bend for (_, bend), fit in zip(loops, fits, strict=True)])
        caption += f", and the identified model. Over all: RMSE {np.sqrt(np.mean(error**2)):.2f} deg"
    return drawn(loop_figure(loops[:_DRAWN], fits[:_DRAWN]), f"{caption}.")


def _training(path: Path) -> Picture:
    curves = {}
    for folder, agent in agent_names().items():
        progress = path / folder / "progress.csv"
        if progress.is_file():
            curves[agent] = read_progress(progress)
    if not curves:
        raise InputError("no agent in it has a progress.csv")
    caption = "What each agent pays per step while it learns, thin as recorded, thick the running median."
    return drawn(training_figure(curves), caption)
