"""Card of a dataset: a README.md that describes it, with a figure of its loops."""

import dataclasses
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from tabulate import tabulate

from twin.dataset.recipe import EpisodeKey, Recipe
from twin.episode import Episode
from twin.files.assets import card_environment
from twin.files.atomic import write_whole
from twin.files.dataset_json import SimulatedDataset, SimulatedFile
from twin.files.shown import in_code
from twin.preset.file import load_preset, preset_names
from twin.recording import read_episode
from twin.report.figures import INK, MEASUREMENT, MUTED, clean_axes, to_png_bytes
from twin.vision.rig import StereoRig

Array = NDArray[np.float64]

CARD, FIGURE = "README.md", "loops.png"
PANELS_PER_ROW, MOST_PANELS = 5, 10
DPI = 150
POINTS = 400  # measurements that a panel shows: all of them would be a grey band


def write_figure(folder: Path, recipe: Recipe) -> None:
    """Draw the figure of the README.md into the folder of a dataset that has the episodes of `shown_keys`."""
    paths = [folder / recipe.file_name(key) for key in shown_keys(recipe)]
    episodes = (read_episode(path, hidden=False) for path in paths)  # one in memory at a time
    write_whole(folder / FIGURE, to_png_bytes(loops_figure(episodes), DPI))


def card_text(recipe: Recipe, contents: SimulatedDataset) -> str:
    """Return the text of the README.md of a dataset, from its recipe and its `dataset.json`."""
    return (
        card_environment()
        .get_template("dataset_card.md.j2")
        .render(
            hub_name=json.dumps(f"Hysteresis of {recipe.preset.name}"),
            episodes=contents.episodes,
            seconds_each=f"{recipe.seconds:g}",
            total=_duration(contents.seconds),
            preset=in_code(recipe.preset.name),
            endotwin=contents.endotwin,
            mujoco=contents.mujoco,
            figure=FIGURE,
            caption=_caption(len(shown_keys(recipe)), contents.episodes),
            varies="\n".join(f"- {line}" for line in varying(recipe, contents.files)),
            rate=f"{1 / recipe.sample_time_s:g}",
            features=_features(contents),
            first=contents.files[0].name,
            stereo=recipe.stereo is not None,
            size=_size(contents.bytes, contents.seconds),
        )
    )


def loops_figure(episodes: Iterable[Episode]) -> Figure:
    """Draw the loop of each episode, bending angle over pull, in a panel of its own; the axes are shared."""
    loops = [_loop(episode) for episode in episodes]
    columns = min(len(loops), PANELS_PER_ROW)
    rows = -(-len(loops) // PANELS_PER_ROW)
    figure = Figure(figsize=(max(2.1 * columns, 4.2) + 0.5, 2.1 * rows + 0.5), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in grid.flat[len(loops) :]:
        axes.set_visible(False)
    for axes, (title, loop, seen) in zip(grid.flat, loops, strict=False):
        axes.plot(*seen, linestyle="", zorder=1, **MEASUREMENT)
        axes.plot(*loop, color=INK, linewidth=0.9, zorder=2)
        axes.set_title(title, fontsize=8, color=MUTED)
        clean_axes(axes).tick_params(labelsize=7, color=MUTED, labelcolor=MUTED)
    figure.supxlabel("pull of wire a [mm]", fontsize=9, color=INK)
    figure.supylabel("bending angle [deg]", fontsize=9, color=INK)
    return figure


def _loop(episode: Episode) -> tuple[str, Array, Array]:
    """Return title, (2, N) pull [mm] and true angle [deg], and (2, some) pull and measured angle, thinned."""
    title = str(episode.metadata.get("signal", "")).replace("-", " ")
    if bend := episode.metadata.get("sheath_bend_deg"):
        title += f", sheath {_bend(bend, '°')}"
    thinned = slice(None, None, max(len(episode.time) // POINTS, 1))
    seen = np.stack([episode.pull_mm[thinned], episode.measured_deg[thinned]])
    return title, np.stack([episode.pull_mm, episode.truth_deg]), seen


def shown_keys(recipe: Recipe) -> list[EpisodeKey]:
    """Return the first episodes of one seed, or, where combinations are many, some spread over these."""
    first = recipe.keys[: min(recipe.episodes, max(recipe.combinations, PANELS_PER_ROW))]
    places = np.linspace(0, len(first) - 1, min(len(first), MOST_PANELS)).round().astype(int)
    return [first[place] for place in places]


def _caption(shown: int, episodes: int) -> str:
    if episodes == 1:
        return "The loop of the episode."
    return f"Loops of {'all' if shown == episodes else f'{shown} of the'} {episodes} episodes."


def varying(recipe: Recipe, files: Sequence[SimulatedFile]) -> list[str]:
    """Return the conditions that vary over episodes, the endoscope and the sensor, a line each."""
    lines = []
    if recipe.given_pull_m is None:
        lines.append(f"signals: {_all_of(files, 'signal', str)}")
        lines.append(f"strokes: {_all_of(files, 'stroke_mm', _stroke)} mm")
    else:
        lines.append("a given command, in `recipe.yaml`")
    if recipe.given_lateral_pull_m is not None:
        lines.append("a given command sideways, in `recipe.yaml`")
    if recipe.lateral_stroke_mm is not None:
        lines.append(f"stroke sideways: {_stroke(recipe.lateral_stroke_mm)} mm, by the next of the signals")
    if recipe.sheath_bends_deg:
        lines.append(f"bend of the sheath: {_all_of(files, 'sheath_bend_deg', _bend)} deg")
    elif recipe.ranges is None or "sheath_bend" not in recipe.ranges.to_dict():
        lines.append(f"bend of the sheath: {np.degrees(recipe.preset.sheath_bend):g} deg")
    if recipe.ranges is not None and recipe.ranges.limits:
        drawn = (f"`{name}` [{low:g}, {high:g}]" for name, low, high in recipe.ranges.limits)
        lines.append(f"each episode's endoscope, drawn (SI units): {', '.join(drawn)}")
    changed = _changed(recipe)
    if changed:
        lines.append(f"other than the preset {in_code(recipe.preset.name)} (SI units): {changed}")
    lines.append(f"sensor: {_sensor(recipe)}")
    if recipe.camera is not None:
        camera = recipe.camera
        lines.append(f"camera: {camera.width} x {camera.height}, {camera.pictures_per_second:g} per second")
    each = f"{recipe.episodes} episode{'s' * (recipe.episodes > 1)} each"
    lines.append(f"seeds: {', '.join(map(str, recipe.seeds))}, with {each}")
    return lines


def _all_of(files: Sequence[SimulatedFile], name: str, say: Callable[[Any], str]) -> str:
    return ", ".join(dict.fromkeys(say(getattr(file, name)) for file in files))


def _stroke(ends: Sequence[float]) -> str:
    return f"[{ends[0]:g}, {ends[1]:g}]"


def _bend(ends: Sequence[float], unit: str = "") -> str:
    start, end = (f"{angle:g}{unit}" for angle in ends)
    return start if start == end else f"{start} to {end}"


def _changed(recipe: Recipe) -> str:
    """The parameters that are not those of the product's preset of that name, but for the sensor's."""
    if recipe.preset.name not in preset_names():
        return ""
    own = load_preset(recipe.preset.name).to_dict()
    drawn = {} if recipe.ranges is None else recipe.ranges.to_dict()
    return ", ".join(
        f"`{name}` = {value:g}"
        for name, value in recipe.preset.to_dict().items()
        if value != own[name] and name not in drawn and not name.startswith("sensor_")
    )


def _sensor(recipe: Recipe) -> str:
    if recipe.stereo is not None:
        usual, rig = dataclasses.asdict(StereoRig()), dataclasses.asdict(recipe.stereo)
        what = "a marker on the tip" if rig["method"] == "markers" else "the silhouette"
        pairs = f"{rig['frames_per_second']:g} pairs of pictures per second"
        line = f"two calibrated cameras, {pairs}, angle by {what}"
        changed = [f"{name} {value}" for name, value in rig.items() if value != usual[name]]
        return f"{line}; {', '.join(changed)}" if changed else line
    preset = recipe.preset
    parts = [f"white noise of {recipe.sensor_variance_deg2:g} deg² in addition to its own"]
    if preset.sensor_noise:
        parts.append(f"noise of {np.degrees(preset.sensor_noise):.3g} deg")
    if preset.sensor_resolution:
        parts.append(f"steps of {np.degrees(preset.sensor_resolution):.3g} deg")
    if preset.sensor_period:
        parts.append(f"a reading every {preset.sensor_period:g} s")
    if preset.sensor_latency:
        parts.append(f"late by {preset.sensor_latency:g} s")
    if len(parts) == 1 and not (recipe.ranges and "sensor_noise" in recipe.ranges.to_dict()):
        parts = [f"white noise of {recipe.sensor_variance_deg2:g} deg²"]
    return ", ".join(parts)


def _features(contents: SimulatedDataset) -> str:
    rows = []
    for name, feature in contents.features.items():
        held = contents.statistics[name]
        shape = " x ".join(map(str, feature.shape)) or "1"
        figures = [f"{figure:.4g}" for figure in (held.min, held.max, held.mean, held.std)]
        unit, topic = feature.unit, f"`{feature.topic}`"
        rows.append([f"`{name}`", feature.meaning, unit, topic, shape, *figures, held.count])
    headers = ["quantity", "what", "unit", "topic", "per sample", "min", "max", "mean", "std", "count"]
    return tabulate(rows, headers=headers, tablefmt="github", disable_numparse=True)


def _duration(seconds: float) -> str:
    minutes = seconds / 60
    if minutes < 2:
        return f"{seconds:g} s"
    return f"{minutes:.4g} minutes" if minutes < 120 else f"{minutes / 60:.3g} hours"


def _size(count: int, seconds: float) -> str:
    return f"{count / 1e6:.3g} MB in all, {count / 1e6 / (seconds / 60):.2g} MB per minute of record"
