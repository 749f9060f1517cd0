"""Bending angle without a marker on the tip: a bent line in space, fitted to the middle of both silhouettes.

A marker on the shaft gives the beginning of the section. From there the angle of the line is a polynomial of
the length; its coefficients are those for which both pictures of the line run midway between the edges of the
silhouette (Gauss-Newton).
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.kinematics import link_frames
from twin.physics.drawing.drawn import OUTER, Plate
from twin.preset.preset import Preset
from twin.vision.bench import BASE, Pair, marker_plates, marker_side
from twin.vision.calibration import StereoCalibration
from twin.vision.markers import MarkerFinder, Pose, mean_rotation
from twin.vision.optics import Optics, cv2
from twin.vision.rig import StereoRig

Array = NDArray[np.float64]
Smooth = NDArray[np.float32]
LARGEST_RESIDUAL = 0.6
"""Largest root mean square by which the line may miss the middle of the silhouettes [pixels]."""
_DEGREE = 4  # of the polynomial
_PLACES, _END = 30, 2  # along the section, at which the silhouette is measured; and at the tip, where not
_REACH, _STEPS = 2.4, 41  # to either side, in half thicknesses, and steps across
_THICKNESS = (0.75, 1.3)  # of a silhouette, of what it should be
_ROUNDS, _FIRST_ROUNDS = 15, 6
_STILL, _LARGEST_STEP = np.radians(0.003), np.radians(15)  # of the line's angle in one round
_STARTS_DEG = (0, 25, -25, 50, -50, 75, -75, 95, -95)
_LEAST_SEEN, _TIP_SHARE = 0.85, 0.2
_BLUR = 0.8  # of the pictures, before edges are sought [pixels]


@dataclasses.dataclass(frozen=True)
class _Fit:
    coefficients: Array  # of its angle in each plane, (planes, degree) [rad]
    residual: float  # root mean square by which it misses their middle [pixels]
    seen: float  # share of its places where the worse camera sees both edges; 0 if the tip is hidden

    @property
    def is_good(self) -> bool:
        return self.seen >= _LEAST_SEEN and self.residual <= LARGEST_RESIDUAL


class SilhouetteMeter:
    """Meter of the bending angle by the silhouette of the section; it starts from the last picture."""

    def __init__(self, calibration: StereoCalibration, preset: Preset, rig: StereoRig) -> None:
        self._cameras = calibration.left, calibration.right
        self._length, self._radius = preset.section_length, OUTER * preset.wire_offset
        self._planes = preset.bending_planes
        self._finder = MarkerFinder(calibration, marker_side(preset, rig))
        self._plate = next(plate for plate in marker_plates(preset, rig) if plate.body == "base")
        self._base = Pose(np.eye(3), np.zeros(3))
        self._offset = 0.0
        self._last: Array | None = None
        # A chain turns at the beginning of each link, half a link ahead of a smooth line.
        middles = (np.arange(_PLACES + _END) + 0.5) / (_PLACES + _END)
        share = np.clip(middles + 0.5 / preset.vertebrae, 0.0, 1.0)
        powers = np.stack([share**power for power in range(1, _DEGREE + 1)])
        self._steps = np.diff(powers, prepend=0.0)  # by which the line turns before each place

    def zero(self, pairs: list[Pair]) -> int:
        """Set the zero from pictures of the straight endoscope; returns the number of measured pairs."""
        self._finder.measure_sizes(pairs)
        poses = [pose for pose in (self._finder.poses(pair).get(BASE) for pair in pairs) if pose is not None]
        if not poses:
            return 0
        self._base = _base_of(poses, self._plate)
        angles = np.array([self.angle(pair) for pair in pairs])
        seen = np.isfinite(angles)
        if seen.any():
            self._offset = float(angles[seen].mean())
        return int(seen.sum())

    def forget(self) -> None:
        """Forget the line: another episode begins."""
        self._last = None

    def angle(self, pair: Pair) -> float:
        """Return the bending angle in the plane of wires a and b [rad]; NaN where it is unknown."""
        smooth = [cv2.GaussianBlur(picture, (0, 0), _BLUR).astype(np.float32) for picture in pair]
        fit = None if self._last is None else self._laid(smooth, self._last, _ROUNDS)
        if fit is None or not fit.is_good:
            fit = self._sought(smooth)
        if not fit.is_good:
            return float("nan")
        self._last = fit.coefficients
        return float(fit.coefficients[0].sum()) - self._offset

    def _sought(self, smooth: list[Smooth]) -> _Fit:
        best: _Fit | None = None
        for bend in np.radians(_STARTS_DEG):
            fit = self._laid(smooth, self._arc(bend), _FIRST_ROUNDS)
            if best is None or (fit.seen, -fit.residual) > (best.seen, -best.residual):
                best = fit
            if best.is_good:
                break
        assert best is not None
        return self._laid(smooth, best.coefficients, _ROUNDS)

    def _arc(self, bend: float) -> Array:
        coefficients = np.zeros((self._planes, _DEGREE))
        coefficients[0, 0] = bend
        return coefficients

    def _laid(self, smooth: list[Smooth], start: Array, rounds: int) -> _Fit:
        """Fit the line to the silhouettes, from coefficients on (Gauss-Newton)."""
        coefficients = start.copy()
        for _ in range(rounds):
            off, seen, normals = self._offsets(smooth, coefficients)
            if seen.sum() < 2 * coefficients.size:
                break
            slopes = self._slopes(coefficients, normals)[seen]
            step = np.linalg.lstsq(slopes, off[seen], rcond=1e-6)[0].reshape(coefficients.shape)
            turned = np.abs(np.cumsum(step @ self._steps, axis=1)).max()
            coefficients = coefficients + step * min(1.0, _LARGEST_STEP / max(turned, 1e-12))
            if turned < _STILL:
                break
        off, seen, _ = self._offsets(smooth, coefficients)
        by_camera = seen.reshape(2, _PLACES)
        tip_seen = by_camera[:, round(_PLACES * (1 - _TIP_SHARE)) :].all()
        residual = float(np.sqrt(np.mean(off[seen] ** 2))) if seen.any() else np.inf
        return _Fit(coefficients, residual, float(by_camera.mean(axis=1).min()) if tip_seen else 0.0)

    def _points(self, coefficients: Array) -> Array:
        """Return base and places of the line in the axes of the left camera, (places + 1, 3) [m]."""
        turns = coefficients @ self._steps
        lateral = turns[1:] if self._planes == 2 else np.empty(0)
        points: Array = link_frames(turns[:1], lateral, self._length).position[0]
        return points[: _PLACES + 1] @ self._base.rotation.T + self._base.position

    def _slopes(self, coefficients: Array, normals: Array) -> Array:
        """Return the motion of the line's pictures along their normals per coefficient, (2 places, all)."""
        columns, small = [], 1e-5
        for index in np.ndindex(coefficients.shape):
            step = np.zeros_like(coefficients)
            step[index] = small
            ahead, behind = (
                np.concatenate([camera.project(self._points(moved))[1:] for camera in self._cameras])
                for moved in (coefficients + step, coefficients - step)
            )
            columns.append(((ahead - behind) * normals).sum(axis=1) / (2 * small))
        return np.stack(columns, axis=1)

    def _offsets(self, smooth: list[Smooth], coefficients: Array) -> tuple[Array, NDArray[np.bool_], Array]:
        """Return the offsets of the middle of the silhouettes from the line, along its normals.

        (2 places) offsets in the left and then in the right picture [pixels]; whether both edges are seen;
        normals (2 places, 2).
        """
        points = self._points(coefficients)
        parts = [
            _middles(picture, camera, points, self._radius)
            for picture, camera in zip(smooth, self._cameras, strict=True)
        ]
        off, seen, normals = (np.concatenate(part) for part in zip(*parts, strict=True))
        return off, seen, normals


def _middles(
    picture: Smooth, camera: Optics, points: Array, radius: float
) -> tuple[Array, NDArray[np.bool_], Array]:
    """Return offsets of the silhouette's middle at each place but the first, if seen, and the normals."""
    pixels = camera.project(points)
    along = np.gradient(pixels, axis=0)[1:]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normals = np.stack([-along[:, 1], along[:, 0]], axis=1)
    depth = (points[1:] @ camera.rotation.T + camera.translation)[:, 2]
    half = camera.matrix[0, 0] * radius / depth
    steps = np.linspace(-_REACH, _REACH, _STEPS)
    paths = pixels[1:, None] + (half[:, None] * steps)[..., None] * normals[:, None]
    across = cv2.remap(
        picture,
        paths[..., 0].astype(np.float32),
        paths[..., 1].astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=0,
    )
    bright = float(np.median(picture))
    level = (bright + np.minimum(across.min(axis=1), bright)) / 2
    off, thick = _edges(across < level[:, None], across, level, steps)
    seen = (thick > 2 * _THICKNESS[0]) & (thick < 2 * _THICKNESS[1])
    return np.where(seen, off, 0.0) * half, seen, normals


def _edges(dark: NDArray[np.bool_], across: Smooth, level: Array, steps: Array) -> tuple[Array, Array]:
    """Return middle and thickness of the dark stretch about the darkest sample of each row, in steps.

    The thickness is infinite where the stretch reaches an end.
    """
    rows, count = np.arange(len(dark)), dark.shape[1]
    darkest = np.argmin(across, axis=1)
    places = np.arange(count)
    light_left = np.where(~dark & (places < darkest[:, None]), places, -1).max(axis=1)
    light_right = np.where(~dark & (places > darkest[:, None]), places, count).min(axis=1)
    open_ended = (light_left < 0) | (light_right >= count)
    left, right = np.clip(light_left, 0, count - 2), np.clip(light_right, 1, count - 1)
    spacing = steps[1] - steps[0]

    def crossing(light: NDArray[np.intp], inner: NDArray[np.intp]) -> Array:
        bright, shade = across[rows, light], across[rows, inner]
        share = np.divide(bright - level, bright - shade, out=np.zeros(len(rows)), where=bright > shade)
        place: Array = steps[light] + np.clip(share, 0, 1) * (inner - light) * spacing
        return place

    begin, end = crossing(left, left + 1), crossing(right, right - 1)
    return (begin + end) / 2, np.where(open_ended, np.inf, end - begin)


def _base_of(poses: list[Pose], plate: Plate) -> Pose:
    """Return the pose of the shaft's end in the axes of the left camera, from poses of its marker."""
    rotation = mean_rotation([pose.rotation for pose in poses])
    position = np.mean([pose.position for pose in poses], axis=0)
    right, down = np.array(plate.right), np.array(plate.down)
    axes = np.column_stack([right, down, np.cross(right, down)])  # of the marker, in those of the shaft
    turned = rotation @ axes.T
    return Pose(turned, position - turned @ np.array(plate.centre))
