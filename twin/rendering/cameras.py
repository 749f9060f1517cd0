"""Cameras of pictures (side, top, tip, overview, endoscopic), soft shadows, and portraits in a simulation.

A blurred shadow needs no edges: it is drawn from the centre line and the thickness of the endoscope alone,
which costs the renderer nothing and suits any background.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter

from twin.mechanics.kinematics import link_frames
from twin.physics.drawing.canvas import Layer, View
from twin.physics.drawing.drawn import OUTER, DrawnEndoscope, cap_length, wheel_place
from twin.preset.preset import Preset
from twin.rendering.actor import PLAIN, Actor
from twin.rendering.look import WHITE
from twin.rendering.picture import Picture, on_paper

SIZE = 480  # width and height of a picture of a simulation [pixels]
# Centre of a portrait's view in front of the base, and half its height, in lengths of the section: they hold
# every arc of constant curvature, whose tip goes from -0.22 to 1 lengths ahead and 0.73 to a side.
_AHEAD, _HALF_HEIGHT = 0.35, 0.9
Array = NDArray[np.float64]
_X, _Y, _Z = np.eye(3)
_FIELD_OF_VIEW = np.radians(95)  # of the endoscope's own lens, top to bottom
_SHADOW_ROOM = 0.07  # at the side and below what is seen, in lengths of the section
_ROUND = 0.42  # radius of a round picture
_ASIDE = (0.07, 0.045)  # by which it is right and low: the numbers are above
_ELEVATION, _AZIMUTH = np.radians(33), np.radians(14)  # of the overview
_REDUCED = 2  # a blurred picture is as good at half its size


class Portrait:
    """Drawing of a simulated endoscope in its pose; only the hinge angles are read."""

    def __init__(self, preset: Preset) -> None:
        self._drawn = DrawnEndoscope(preset)
        self._drawn.paint_wires(PLAIN[: preset.wires, None])
        length = preset.section_length
        self._view = View(
            position=np.array([_AHEAD * length, -4 * length, 0.0]),
            forward=np.array([0.0, 1.0, 0.0]),
            up=np.array([0.0, 0.0, 1.0]),
            half_height=_HALF_HEIGHT * length,
            parallel=True,
        )
        self._drawn.open_canvas(SIZE, SIZE)

    def picture(self, joint_angle: NDArray[np.float64]) -> Picture:
        """Return a picture on white, (`SIZE`, `SIZE`, 3), at hinge angles (vertebrae,) [rad]."""
        length = self._drawn.preset.section_length
        self._drawn.stand(link_frames(joint_angle[None], np.empty(0), length), 0)
        return on_paper(self._drawn.draw(self._view), WHITE)


class Caster(NamedTuple):
    """Object that throws a shadow: its centre line (n, 3) and half its thickness [m]."""

    line: Array
    radius: float


class Screen(NamedTuple):
    """Plane on which a shadow falls."""

    point: Array  # (3,) on it [m]
    normal: Array  # (3,) unit vector
    light: Array  # (3,) direction of the light
    blur: float  # standard deviation of the soft edge [m]


@dataclasses.dataclass(frozen=True)
class Shot:
    """Camera, and what goes with it."""

    scene: str  # what is around the actor, see `DrawnEndoscope`
    view: Callable[[Actor, int], View]  # camera (actor, index of the sample); some follow the tip
    screen: Screen | None = None  # where shadows fall; None: nowhere
    has_scale: bool = False  # a length is the same all over the picture: a scale bar is valid
    is_round: bool = False  # the round picture of an endoscope
    follows: bool = False  # the camera moves with the tip: poses cannot lie over one another

    def casters(self, actor: Actor, index: int) -> list[Caster]:
        """Return what throws shadows at a sample."""
        radius = OUTER * actor.preset.wire_offset
        if self.scene != "overview":
            line = np.array([[-actor.preset.section_length, 0, 0], *actor.chain[index]])
            forward = self.view(actor, index).forward
            # A pose that leaves the plane of the picture keeps its shadow next to it.
            return [Caster(line - np.outer(line @ forward, forward), radius)]
        sheath = actor.sheath(index)
        casters = [Caster(np.concatenate([sheath.position[::-1], actor.chain[index]]), radius)]
        wheel = actor.preset.pulley_radius
        for plane in range(actor.preset.bending_planes):
            centre = sheath.position[-1] + sheath.rotation[-1] @ np.array(wheel_place(actor.preset, plane))
            rim = centre + 0.6 * wheel * np.array([[0, 0, -1.0], [0, 0, 1.0]])
            casters.append(Caster(rim, 0.55 * wheel))
        return casters


def scene_of(camera: str) -> str:
    """Return what is around the actor for a camera."""
    return {"overview": "overview", "endoscopic": "lumen"}.get(camera, "bench")


def shot(camera: str, actors: Sequence[Actor], aspect: float) -> Shot:
    """Return the shot of a camera that holds every pose of all actors; the aspect is width over height."""
    if camera == "overview":
        return _overview(actors, aspect)
    if camera == "tip":
        return Shot("bench", _tip_view, follows=True)
    if camera == "endoscopic":
        return _endoscopic(aspect)
    return _flat(actors, aspect, up=_Y if camera == "top" else _Z)


def _flat(actors: Sequence[Actor], aspect: float, up: Array) -> Shot:
    reach, right = max(actor.preset.section_length for actor in actors), _X
    forward = np.cross(up, right)
    points = np.concatenate([actor.chain.reshape(-1, 3) for actor in actors]) @ np.stack([right, up], axis=1)
    low = np.minimum([-0.22 * reach, -0.30 * reach], points.min(axis=0))
    high = np.maximum([0.75 * reach, 0.30 * reach], points.max(axis=0))
    low[1], high[0] = low[1] - _SHADOW_ROOM * reach, high[0] + _SHADOW_ROOM * reach
    centre, half = (high + low) / 2, (high - low) / 2
    half_height = float(1.16 * max(half[1], half[0] / aspect))
    position = centre[0] * right + centre[1] * up - 4 * reach * forward
    view = View(position, forward, up, half_height, parallel=True)
    wall = Screen(0.14 * reach * forward, forward, forward + 0.55 * right - 0.9 * up, 0.035 * reach)
    return Shot("bench", lambda actor, index: view, wall, has_scale=True)


def _overview(actors: Sequence[Actor], aspect: float) -> Shot:
    reach = max(actor.preset.section_length for actor in actors)
    turn = np.array([np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
    forward = np.cos(_ELEVATION) * turn - np.sin(_ELEVATION) * _Z
    up = np.sin(_ELEVATION) * turn + np.cos(_ELEVATION) * _Z
    points = np.concatenate([_extent(actor) for actor in actors])
    floor = float(points[:, 2].min()) - 0.05 * reach
    light = np.array([0.22, 0.25, -1.0])
    fallen = points + (points[:, 2:] - floor) * light
    view = _fitted(np.concatenate([points, fallen]), forward, up, aspect, 12 * reach)
    screen = Screen(np.array([0, 0, floor]), _Z, light, 0.05 * reach)
    return Shot("overview", lambda actor, index: view, screen)


def _extent(actor: Actor) -> Array:
    """Return points (n, 3) that hold all of an actor in all of its poses [m]."""
    bend = actor.episode.sheath_bend
    samples = {0, len(actor.episode.time) - 1}
    if len(bend):
        samples |= {int(bend.argmin()), int(bend.argmax())}
    size = 1.2 * actor.preset.pulley_radius
    corners = size * np.array([[x, y, z] for x in (-1, 1) for y in (-1.5, 1.5) for z in (-1, 1)])
    points = [actor.chain.reshape(-1, 3)]
    for index in samples:
        frames = actor.sheath(index)
        points.append(frames.position)
        for plane in range(actor.preset.bending_planes):
            centre = np.array(wheel_place(actor.preset, plane))
            points.append(frames.position[-1] + (centre + corners) @ frames.rotation[-1].T)
    return np.concatenate(points)


def _fitted(points: Array, forward: Array, up: Array, aspect: float, distance: float) -> View:
    """Return a perspective view from a distance that just holds points (n, 3)."""
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    wide = View(middle - distance * forward, forward, up, 1.0)
    seen = (wide.project(points, 2, 2) - 1) * [1, -1]
    low, high = seen.min(axis=0), seen.max(axis=0)
    half = float(1.1 * max((high[1] - low[1]) / 2, (high[0] - low[0]) / 2 / aspect))
    across, along = (high + low) / 2 / half
    return dataclasses.replace(wide, half_height=half, shift=(float(across), float(along)))


def _tip_view(actor: Actor, index: int) -> View:
    """Return a view that follows the tip, and turns half as far as it does."""
    tip, radius = actor.links.position[index, -1], actor.preset.wire_offset
    axes = actor.links.rotation[index, -1]
    ahead = axes[:, 0] + _X
    ahead = ahead / np.linalg.norm(ahead) if np.linalg.norm(ahead) > 0.2 else axes[:, 0]
    upright = _Z - (_Z @ ahead) * ahead
    upright = upright / np.linalg.norm(upright) if np.linalg.norm(upright) > 0.2 else axes[:, 2]
    from_tip = 0.80 * ahead - 0.62 * np.cross(upright, ahead) + 0.30 * upright
    from_tip /= np.linalg.norm(from_tip)
    forward = -from_tip
    up = upright - (upright @ forward) * forward
    target = tip - 1.6 * radius * axes[:, 0]
    return View(target + 26 * radius * from_tip, forward, up / np.linalg.norm(up), 0.19)


def _endoscopic(aspect: float) -> Shot:

    def view(actor: Actor, index: int) -> View:
        axes = actor.links.rotation[index, -1]
        radius, lens = actor.preset.wire_offset, cap_length(actor.preset)
        place = axes @ np.array([lens + 0.25 * radius, 0.0, 0.46 * radius])
        position = actor.links.position[index, -1] + place
        half_height = float(np.tan(_FIELD_OF_VIEW / 2)) / (2 * _ROUND * min(aspect, 1.0))
        shift = (-2 * _ASIDE[0] * aspect, 2 * _ASIDE[1])
        return View(position, axes[:, 0], axes[:, 2], half_height, shift=shift)

    return Shot("lumen", view, is_round=True, follows=True)


def rounded(layer: Layer) -> Layer:
    """Return the round picture of an endoscope, dark towards its rim, out of one that fills its frame."""
    height, width = layer.shape[:2]
    radius = _ROUND * min(width, height)
    middle = (0.5 + _ASIDE[0]) * width, (0.5 + _ASIDE[1]) * height
    mask = Image.new("L", (2 * width, 2 * height))
    box = [2 * (place + side * radius) for side in (-1, 1) for place in middle]
    ImageDraw.Draw(mask).ellipse(box, 255)
    alpha = np.asarray(mask.reduce(2), dtype=float) / 255
    rows, columns = np.mgrid[:height, :width]
    away = np.hypot(columns - middle[0], rows - middle[1]) / radius
    light = np.clip(1.12 - 0.5 * away**3, 0.0, 1.0)
    shaded = layer[..., :3] * (light * alpha)[..., None]
    return np.concatenate([np.rint(shaded), 255 * alpha[..., None]], axis=-1).astype(np.uint8)


def shadow(
    casters: Sequence[Caster], screen: Screen, view: View, width: int, height: int, darkness: float
) -> Layer:
    """Return the shadow of casters as a black layer, (height, width, 4); darkness is its alpha, 0 to 1."""
    mask = Image.new("L", (-(-width // _REDUCED), -(-height // _REDUCED)))
    pen, scale = ImageDraw.Draw(mask), 1.0
    for caster in casters:
        away = (screen.point - caster.line) @ screen.normal / (screen.light @ screen.normal)
        fallen = caster.line + away[:, None] * screen.light
        points = view.project(fallen, width, height) / _REDUCED
        depth = 1.0 if view.parallel else float((fallen.mean(axis=0) - view.position) @ view.forward)
        scale = height / 2 / view.half_height / depth / _REDUCED  # pixels per metre
        thick = max(round(2 * caster.radius * scale), 1)
        pen.line([tuple(point) for point in points], 255, thick, joint="curve")
    blurred = mask.filter(ImageFilter.GaussianBlur(screen.blur * scale))
    soft = blurred.resize((width, height), Image.Resampling.BILINEAR)
    layer = np.zeros((height, width, 4), dtype=np.uint8)
    layer[..., 3] = np.rint(np.asarray(soft) * darkness)
    return layer
