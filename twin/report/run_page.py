"""The pages of a run folder, and of one training run: data, model, learning curves, and every method."""

import contextlib
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from markupsafe import Markup
from pydantic import BaseModel, ConfigDict, Field

from twin.episode import Episode
from twin.errors import InputError
from twin.estimation.learned.methods import POLICY_FILE
from twin.estimation.registry import method_specs, proposed_method, trainings
from twin.evaluation.ranking import rankings_of
from twin.evaluation.score import Score, read_evaluation
from twin.files.assets import assets_folder
from twin.files.bounded import MEBIBYTE, read_limited, sha256_of
from twin.files.dataset_json import NAME, MeasuredDataset, read_contents, to_json_values
from twin.files.json_text import read_json
from twin.files.run_folder import CURVE_FILE, read_progress
from twin.files.shown import cut
from twin.files.yaml_text import read_yaml
from twin.hysteresis import ColemanHodgdon, HysteresisModel, load_model
from twin.preset.file import preset_of
from twin.recording import read_dataset
from twin.report import page as html
from twin.report.evaluation_page import answer, error_table, result_parts, tracking_parts
from twin.report.figures import loop_figure, training_figure
from twin.report.player import bending_schematic, player
from twin.report.tables import front_scores

Value = TypeVar("Value")
MOST_TEXT = MEBIBYTE  # size that is read of files of settings and curves [bytes]
LARGEST_FILM = 32 * MEBIBYTE  # size of a film that a page holds [bytes]: larger pages open slowly
DIAGRAMS = assets_folder() / "diagrams"
_DRAWN = 2  # loops that are drawn over each other: more cannot be distinguished
_FAULTS = (OSError, ValueError, KeyError, TypeError, AttributeError, ArithmeticError)
"""Errors of reading what is missing or damaged."""
_POSES = (
    "Poses along one record, and their places on its hysteresis loop. Poses 2 and 3 have the same pull on "
    "the wires: the bend depends on where the tip came from."
)
_LEARNING = "Cost of each agent per step while it learns, thin as recorded, thick the running median."


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
    """Contents of `demo.json` that the page needs: the commands that made the run."""

    model_config = ConfigDict(frozen=True, strict=True)

    commands: Annotated[list[Annotated[str, Field(max_length=2000)]], Field(max_length=100)]


def run_page(folder: Path) -> html.Page:
    """Return the page of a run folder; a missing part is named with the command that makes it."""
    train, test = (
        functools.cache(functools.partial(read_dataset, folder / "data" / of)) for of in ("train", "test")
    )
    model = functools.cache(functools.partial(_coleman_hodgdon, folder / "coleman_hodgdon.json"))
    evaluation = functools.cache(functools.partial(read_evaluation, folder / "results" / "evaluation.json"))
    shown = functools.partial(_shown, folder)

    def results(path: Path) -> Sequence[Markup]:
        scores, contents = evaluation()
        return result_parts(scores, rankings_of(contents))

    def tracking(path: Path) -> Sequence[Markup]:
        there = path.with_name("evaluation.json").is_file()
        return tracking_parts(path, evaluation()[0] if there else [])

    picture = shown("bend.png", lambda path: [html.figure(path, _POSES)])
    scores, _ = _known(evaluation) or ([], {})
    page = html.Page(
        "EndoTwin: a digital twin of a tendon-driven flexible endoscope",
        "Hysteresis, and how well it is estimated",
        intro=(answer(scores), *picture, error_table(front_scores(scores))) if scores else tuple(picture),
    )
    page.add("Errors under every noise", *shown("results/evaluation.json", results))
    page.add("Tracking", *shown("results/tracks.npz", tracking))
    page.add(
        "The bending",
        *([player(episodes[0], "First test record")] if (episodes := _known(test)) else []),
        *shown("bend.mp4", _film),
        *_endoscope(_known(train)),
    )
    page.add(
        "The loop, and the Coleman-Hodgdon model",
        *shown("coleman_hodgdon.json", lambda _: _equation(model())),
        html.side_by_side(
            *shown("data/train", lambda path: _loop(path, train(), _known(model))),
            *shown("data/test", lambda path: _loop(path, test(), _known(model))),
        ),
    )
    page.add("How RAM works, and how it learned", *_schemes(), *shown("runs", _curves))
    stated = _run_facts(folder, evaluation)
    if not stated:
        page.add("What was run", html.gap("No file of this run states how it was made."))
    page.add_origin(_commands_run(folder), stated, "`make demo` runs all of it. Step by step:")
    return page


def _known(read: Callable[[], Value]) -> Value | None:
    """Return what a function reads; None where it is missing or damaged."""
    with contextlib.suppress(*_FAULTS):
        return read()
    return None


def _shown(folder: Path, name: str, show: Callable[[Path], Sequence[Markup]]) -> Sequence[Markup]:
    """Return what shows a part of the run, or what is wrong with it and the command that makes it."""
    command = f"endotwin {run_commands()[name]}"
    if not (folder / name).exists():
        return [html.gap(f"This run has no {name}.", command)]
    try:
        return show(folder / name)
    except _FAULTS as error:
        reason = cut(str(error).replace(f"{folder}/", ""), 300) or type(error).__name__
        return [html.gap(f"{name} cannot be shown: {reason}.", command)]


def _endoscope(train: list[Episode] | None) -> list[Markup]:
    parameters = train[0].metadata.get("preset") if train and train[0].joint_angle.size else None
    if train is None or not isinstance(parameters, dict):
        return []
    given = {name: value for name, value in parameters.items() if name != "name"}
    try:
        preset = preset_of(str(parameters.get("name", "")), given)
    except ValueError as error:
        return [html.gap(f"The endoscope of the training records cannot be drawn: {cut(error, 300)}.")]
    scheme = html.figure(
        bending_schematic(preset, train[0]),
        "As the paper's Fig. 1: the endoscope straight, and at the largest bend of the first training "
        "record. Drawn to scale from the twin's own hinges.",
    )
    platform = html.figure(
        DIAGRAMS / "platform.svg",
        "As the paper's Fig. 3: the platform, here simulated. The backlash of the gear and the friction "
        "of the sheath, between command and angle, make the hysteresis.",
    )
    return [html.folded("The endoscope and the platform: the paper's Figs. 1 and 3", scheme, platform)]


def _film(path: Path) -> Sequence[Markup]:
    content = read_limited(path, LARGEST_FILM)
    if content[4:8] != b"ftyp":
        raise InputError("it is no MP4 film")
    return [html.film(content, "The record replayed, and its loop as it is drawn.")]


def _coleman_hodgdon(path: Path) -> ColemanHodgdon:
    model = load_model(path)
    if not isinstance(model, ColemanHodgdon):
        raise InputError(f"it holds the model {model.name!r}, the page shows that of Coleman and Hodgdon")
    return model


def _equation(model: ColemanHodgdon) -> Sequence[Markup]:
    a, b, c = (float(np.asarray(of)) for of in (model.a_per_mm, model.b_deg_per_mm, model.c_deg_per_mm))
    equation = (
        '<span class="formula">dθ/dt = <i>a</i> |<i>v</i>| (<i>b</i> δ<i>l</i> &minus; θ) + <i>c v</i></span>'
    )
    rises = "c / b, at least 1/2: loops of every size rise with the pull"
    ratio = (
        rises if model.monotone() else "c / b, below 1/2: large loops do not rise with the pull everywhere"
    )
    named = {"a [1 / mm]": a, "b [deg / mm]": b, "c [deg / mm]": c}
    values = [*((name, f"{value:.4g}") for name, value in named.items()), (ratio, f"{c / b:.2f}")]
    return [
        html.text(Markup("{}, with δ<i>l</i> the pull and <i>v</i> its speed.").format(Markup(equation))),
        html.facts({"Identified model": values}),
    ]


def _loop(path: Path, episodes: list[Episode], model: HysteresisModel | None) -> Sequence[Markup]:
    loops = [(episode.pull_mm, episode.truth_deg) for episode in episodes]
    fits = [] if model is None else [model.response(pull, bend[0]) for pull, bend in loops]
    caption = f"The first {min(_DRAWN, len(loops))} of {len(loops)} records of data/{path.name}"
    if model is not None:
        error = np.concatenate([fit - bend for (_, bend), fit in zip(loops, fits, strict=True)])
        caption += f", and the identified model. Over all: RMSE {np.sqrt(np.mean(error**2)):.2f} deg"
    return [html.figure(loop_figure(loops[:_DRAWN], fits[:_DRAWN]), f"{caption}.")]


def _schemes() -> list[Markup]:
    return [
        html.figure(
            DIAGRAMS / "ram.svg",
            "As the paper's Fig. 2: RAM. A Kalman filter predicts by the identified model and corrects "
            "itself by the measurement; the policy sets the gain on the remaining residual.",
        ),
        html.figure(
            DIAGRAMS / "direct.svg",
            "As the paper's Fig. 4: direct RL. The policy takes the place of model and filter.",
        ),
    ]


def agent_names() -> dict[str, str]:
    """Return the names of the methods that can be trained, by the folder of their run."""
    return {spec.training.agent: spec.name for spec in method_specs() if spec.training}


def _curves(path: Path) -> Sequence[Markup]:
    files = {agent: path / folder / CURVE_FILE for folder, agent in agent_names().items()}
    curves = {agent: read_progress(file) for agent, file in files.items() if file.is_file()}
    if not curves:
        raise InputError(f"no agent in it has a {CURVE_FILE}")
    return [html.figure(training_figure(curves), _LEARNING)]


def _commands_run(folder: Path) -> list[str]:
    """The commands that made this run, where it states them; else those that make such a run."""
    with contextlib.suppress(OSError, ValueError):
        return DemoFile.model_validate(read_json(folder / "demo.json", MOST_TEXT)).commands
    made = list(dict.fromkeys(f"endotwin {command}" for command in run_commands().values()))
    return [*made, "endotwin report . --out report.html"]


def _run_facts(
    folder: Path, evaluation: Callable[[], tuple[list[Score], dict[str, Any]]]
) -> dict[str, html.Facts]:
    sources: dict[str, tuple[str, Callable[[Path], Any]]] = {
        "Run": ("demo.json", lambda path: {**read_json(path, MOST_TEXT), "commands": {}}),
        "Training records": ("data/train/dataset.json", _recipe),
        "Test records": ("data/test/dataset.json", _recipe),
        "Identified Coleman-Hodgdon model": ("coleman_hodgdon.json", lambda path: read_json(path, MOST_TEXT)),
        "Evaluation protocol": ("results/evaluation.json", lambda _: evaluation()[1]["protocol"]),
    }
    for name, agent in agent_names().items():
        sources[agent] = f"runs/{name}/config.yaml", lambda path: read_yaml(path, MOST_TEXT)
    stated = {}
    for title, (name, read) in sources.items():
        with contextlib.suppress(*_FAULTS):  # a damaged file is reported by the part that needs it
            stated[title] = html.flat_facts(read(folder / name))
    return {title: entries for title, entries in stated.items() if entries}


def _recipe(path: Path) -> dict[str, Any]:
    """Return what a dataset was made from; of a measured one, what it holds; or what is wrong with it."""
    if not path.is_file():
        return {}
    try:
        contents = read_contents(path.parent)
    except ValueError as error:
        reason = str(error).rpartition("is damaged or of an older version: ")[2]
        return {NAME: f"cannot be shown: {reason}"}
    stated: dict[str, Any] = {f"SHA-256 of {NAME}": sha256_of(path), "endotwin": contents.endotwin}
    if isinstance(contents, MeasuredDataset):
        return stated | {"source": contents.source, "files": len(contents.files), "seconds": contents.seconds}
    return stated | {"mujoco": contents.mujoco} | to_json_values(contents.recipe)


def training_page(path: Path) -> html.Page:
    """Return the page of a run folder of `endotwin train`, from its `config.yaml`."""
    folder, values = path.parent, read_yaml(path, MOST_TEXT)
    known, inner = trainings(), [part for part in values.values() if isinstance(part, dict)]
    named = [str(part["agent"]) for part in (values, *inner) if "agent" in part]
    agent = next((name for name in named if name in known), None)
    if agent is None:
        raise InputError(f"{path} names no agent of `endotwin train`; valid: {', '.join(known)}")
    trained = folder / known[agent].file
    try:
        curve = read_progress(folder / CURVE_FILE)
        first, last = (f"{cost:.3g}" for cost in -curve["return"][[0, -1]])
        sentence = (
            f"Cost per step: {first} deg² at the start, {last} after {curve['samples'][-1]:,.0f} samples."
        )
        learned = [
            html.text(sentence, "headline"),
            html.figure(training_figure({agent_names().get(agent, agent): curve}), _LEARNING),
        ]
    except (OSError, ValueError) as error:
        learned = [html.gap(f"The learning curve cannot be shown: {error}.")]
    if not trained.is_file():
        learned.insert(0, html.gap(f"This training run is not finished: it has left no {trained.name} yet."))
    page = html.Page(
        "EndoTwin training: how an estimator learned",
        f"{agent}: {known[agent].purpose}",
        intro=tuple(learned),
    )
    hashes = {"Trained file, by SHA-256": ((trained.name, sha256_of(trained)),)} if trained.is_file() else {}
    page.add_origin(
        (
            f"endotwin train --agent {agent} --help",
            f"endotwin evaluate data/test --policy {trained} --out results",
            f"endotwin report {folder}",
        ),
        {**hashes, "Configuration": html.flat_facts(values)},
    )
    return page
