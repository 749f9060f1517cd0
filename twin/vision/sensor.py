"""Stereo sensor: the bending angle of an episode as two calibrated cameras measure it, and their messages."""

import functools
import io
import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from twin.episode import Episode
from twin.errors import InputError
from twin.mechanics.kinematics import link_frames
from twin.preset.preset import Preset
from twin.recording.camera import STEREO_SIDES, calibration_message, picture_message, stereo_topics
from twin.rendering.actor import shape_of
from twin.rendering.camera import frame_samples
from twin.vision.bench import Bench, Motion, Pair, Pass, draw_passes, marker_side
from twin.vision.calibration import StereoCalibration, calibrate
from twin.vision.markers import MarkerMeter
from twin.vision.optics import cv2
from twin.vision.rig import StereoRig
from twin.vision.silhouette import SilhouetteMeter

Array = NDArray[np.float64]
QUALITY = 92  # JPEG quality of recorded pictures, out of 100
_ZERO_PICTURES = 20  # pairs of pictures of the straight endoscope, before an episode
_MOST_CALIBRATIONS = 16
# Parameters of a rig that pictures of the still calibration board depend on.
_SEEN_OF_BOARD = ["width", "height", "distance", "angle_deg", "half_height", "blur_px", "brightness"]
_SEEN_OF_BOARD += ["pixel_noise", "distortion", "calibration_views", "seed"]
_PASSES, _PIXELS = 0, 1  # children of an episode's seed: passes, and the noise of each picture


class StereoSensor:
    """Two cameras in front of an endoscope, calibrated, and zeroed on the straight endoscope."""

    def __init__(self, preset: Preset, rig: StereoRig) -> None:
        self.rig, self._preset = rig, preset
        self._bench = Bench(preset, rig)
        self.calibration = _calibrated(self._bench)
        self._bench.set_up()
        self._meter: MarkerMeter | SilhouetteMeter
        if rig.method == "markers":
            side = marker_side(preset, rig)
            self._meter = MarkerMeter(self.calibration, side, preset.bending_planes)
        else:
            self._meter = SilhouetteMeter(self.calibration, preset, rig)
        rng = np.random.default_rng([rig.seed, 2])
        links = link_frames(np.zeros((1, preset.vertebrae)), np.empty(0), preset.section_length)
        pairs = [
            self._bench.take(lambda _: self._bench.stand(links, 0), 0.0, rng) for _ in range(_ZERO_PICTURES)
        ]
        if self._meter.zero(pairs) < _ZERO_PICTURES / 2:
            raise InputError(
                "the straight endoscope is not measured in half of its pictures: less blur, noise or "
                "distortion, more light, or larger markers"
            )

    def measure(
        self,
        episode: Episode,
        seed: np.random.SeedSequence,
        on_progress: Callable[[int, int], None] | None = None,
    ) -> Array:
        """Return the measured bending angle (N,) [rad], NaN where there is no picture or no angle in it."""
        measured = np.full(len(episode.time), np.nan)
        count = len(frame_samples(episode.time, self.rig.frames_per_second))
        self._meter.forget()
        for done, (sample, pair) in enumerate(self.pictures(episode, seed), start=1):
            measured[sample] = self._meter.angle(pair)
            if on_progress is not None:
                on_progress(done, count)
        return measured

    def passes(self, episode: Episode, seed: np.random.SeedSequence) -> list[Pass]:
        """Return the passes of instruments during an episode, with the seed of `measure`."""
        tip = Motion(episode, self._preset).tip
        rng = np.random.default_rng(_child(seed, _PASSES))
        return draw_passes(self.rig, episode.time, tip, self._preset.section_length, rng)

    def pictures(
        self, episode: Episode, seed: np.random.SeedSequence, frames_per_second: float | None = None
    ) -> Iterator[tuple[int, Pair]]:
        """Yield samples and their pairs of pictures; a picture does not depend on which others are taken."""
        motion, bench = Motion(episode, self._preset), self._bench
        taken = frame_samples(episode.time, self.rig.frames_per_second)
        if frames_per_second is not None:
            wanted = frame_samples(episode.time, frames_per_second)
            taken = sorted({max(one for one in taken if one <= sample) for sample in wanted})
        passes = self.passes(episode, seed)
        scale = self.calibration.left.matrix[0, 0] / (self.rig.distance * self._preset.section_length)
        for sample in taken:
            time = float(episode.time[sample])

            def scene(instant: float, time: float = time) -> None:
                bench.stand(motion.links_at(time + instant), 0)
                for one in passes:
                    if (middle := one.middle(time + instant)) is not None:
                        bench.pass_rod(middle, one.along)

            rng = np.random.default_rng(_child(seed, _PIXELS, sample))
            yield sample, bench.take(scene, scale * motion.speed(sample), rng)


def _child(seed: np.random.SeedSequence, *key: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *key))


def sensor_before(episode: Episode, rig: StereoRig) -> StereoSensor:
    """Return the sensor of the endoscope of an episode; it is set up once for endoscopes of one shape."""
    return _READY.sensor(shape_of(episode, max(episode.joint_angle.shape[1], 1)), rig)


class _Ready(threading.local):
    """Sensors of each thread: a renderer belongs to the thread that opened it."""

    def __init__(self) -> None:
        self.sensor = functools.lru_cache(maxsize=2)(StereoSensor)


_READY = _Ready()
_CALIBRATIONS: dict[tuple[float, ...], StereoCalibration] = {}


def _calibrated(bench: Bench) -> StereoCalibration:
    key = (bench.preset.section_length, *(getattr(bench.rig, name) for name in _SEEN_OF_BOARD))
    if key not in _CALIBRATIONS:
        if len(_CALIBRATIONS) >= _MOST_CALIBRATIONS:
            _CALIBRATIONS.clear()
        _CALIBRATIONS[key] = calibrate(bench)
    return _CALIBRATIONS[key]


def calibration_messages(calibration: StereoCalibration, nanoseconds: int) -> Iterator[tuple[str, Any]]:
    """Yield topic and message of each camera's calibration.

    R turns a camera to the pair's common plane, and P projects there (OpenCV's `stereoRectify`): P of the
    right camera holds the baseline.
    """
    left, right = calibration.left, calibration.right
    size = (left.width, left.height)
    optics = left.matrix, left.distortion, right.matrix, right.distortion
    rectified = cv2.stereoRectify(*optics, size, right.rotation, right.translation.reshape(3, 1))
    for place, (side, camera) in enumerate(zip(STEREO_SIDES, (left, right), strict=True)):
        parts = camera.distortion, camera.matrix, rectified[place], rectified[place + 2]
        rows = [np.ravel(part).tolist() for part in parts]
        yield stereo_topics(side)[1], calibration_message(size, rows, nanoseconds, f"camera_{side}")


def picture_messages(
    sensor: StereoSensor, episode: Episode, seed: np.random.SeedSequence, nanoseconds: list[int]
) -> Iterator[tuple[str, Any, int]]:
    """Yield topic, message and time of each recorded picture, at N times of samples [ns]."""
    if sensor.rig.pictures_per_second == 0:
        return
    for sample, pair in sensor.pictures(episode, seed, sensor.rig.pictures_per_second):
        for side, picture in zip(STEREO_SIDES, pair, strict=True):
            buffer, time = io.BytesIO(), nanoseconds[sample]
            Image.fromarray(picture).save(buffer, "JPEG", quality=QUALITY)
            message = picture_message(buffer.getvalue(), time, f"camera_{side}")
            yield stereo_topics(side)[0], message, time
