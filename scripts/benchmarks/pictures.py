"""Speed of drawing without a screen: pictures of every camera, and frames of a film with its loop."""

import time
from collections.abc import Callable

from scripts.benchmarks.harness import SAMPLE_TIME, Result, measurement, sinusoid
from twin.preset.preset import Preset
from twin.rendering.look import CAMERAS, Look
from twin.rendering.overlay import Overlay
from twin.rendering.render import Film
from twin.simulation import simulate

_SIZE = (640, 480)
_FRAMES, _REPEATS = 60, 3


@measurement("rendering")
def pictures(preset: Preset, amplitude: float) -> dict[str, Result]:
    """Measure pictures per second of each camera, and frames of a film with its loop."""
    overlays = [Overlay(simulate(preset, sinusoid(amplitude, 8.0, 1), SAMPLE_TIME, physics="reduced"))]
    looks = {
        f"pictures of the camera `{camera}`": Look(camera=camera, panels="view", size=_SIZE)
        for camera in CAMERAS
    }
    looks["frames of a film with its loop"] = Look(size=_SIZE)
    results = {}
    for (name, look), key in zip(looks.items(), [*(f"pictures_{of}" for of in CAMERAS), "film"], strict=True):
        rate = _frames_per_second(Film(overlays, look, speed=1.0).frame, len(overlays[0].episode.time))
        bar = ">= 15" if key == "film" else ">= 30"
        results[key] = Result(f"{name}, 640 x 480", rate, "per second", bar)
    return results


def _frames_per_second(draw: Callable[[int], object], samples: int) -> float:
    """Return the best rate of some runs: other programs can only slow it down."""
    draw(0)
    rates = []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        for frame in range(_FRAMES):
            draw(frame * (samples - 1) // _FRAMES)
        rates.append(_FRAMES / (time.perf_counter() - start))
    return max(rates)
