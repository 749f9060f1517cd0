"""Speed of drawing without a screen: pictures of every camera, and frames of a film with its loop."""

import time
from collections.abc import Callable

from twin.benchmark.result import Result
from twin.benchmark.signals import SAMPLE_TIME, sinusoid
from twin.preset.preset import Preset
from twin.rendering.film import Film
from twin.rendering.look import CAMERAS, Look
from twin.rendering.overlay import Overlay
from twin.simulation import simulate

_SIZE = (640, 480)
_FRAMES, _REPEATS = 60, 3
_PICTURES_PER_SECOND, _FRAMES_PER_SECOND = 30.0, 15.0


def pictures(preset: Preset, amplitude: float) -> dict[str, Result]:
    """Measure pictures per second of each camera, and frames of a film with its loop beside it."""
    episode = simulate(preset, sinusoid(amplitude, 8.0, 1), SAMPLE_TIME, physics="reduced")
    results = {}
    for camera in CAMERAS:
        film = Film([Overlay(episode)], Look(camera=camera, panels="view", size=_SIZE))
        rate = _frames_per_second(film.frame, len(episode.time))
        results[f"pictures_{camera}"] = _result(
            f"pictures of the camera `{camera}`", rate, _PICTURES_PER_SECOND
        )
    film = Film([Overlay(episode)], Look(size=_SIZE), speed=1.0)
    rate = _frames_per_second(film.frame, len(episode.time))
    results["film"] = _result("frames of a film with its loop", rate, _FRAMES_PER_SECOND)
    return results


def _result(name: str, rate: float, least: float) -> Result:
    return Result(f"{name}, 640 x 480", rate, "per second", f">= {least:g}", rate >= least)


def _frames_per_second(draw: Callable[[int], object], samples: int) -> float:
    """Return the best rate of some runs: what other programs take from this one is not its own."""
    draw(0)
    rates = []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        for frame in range(_FRAMES):
            draw(frame * (samples - 1) // _FRAMES)
        rates.append(_FRAMES / (time.perf_counter() - start))
    return max(rates)
