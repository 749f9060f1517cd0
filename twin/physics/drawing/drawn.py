"""Drawn endoscope: the parts on their stage, which stand as a record states, before any camera.

It is a model of its own, besides the one that is simulated: it has no joints and no masses, and every part is
placed for each picture; rigid ones are bodies, smooth ones skins. Lengths across are in distances of the
wires from the axis (`Preset.wire_offset`), so that an endoscope of any thickness looks alike.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from twin.episode import WIRE_PLACES, WIRES
from twin.files.assets import assets_folder
from twin.mechanics.kinematics import Frames
from twin.physics.drawing.canvas import Canvas, Layer, View
from twin.physics.drawing.lumen import add_lumen
from twin.physics.drawing.surfaces import (
    SHEATH_BONES,
    Array,
    Bones,
    add_skin,
    drawn_sheath_length,
    open_shell,
    rings,
    round_tube,
    sheath_frames,
    window,
)
from twin.preset.preset import Preset

SCENES = ("bench", "overview", "lumen")  # a straight shaft; sheath and pulleys; a cavity lit by the tip alone
SLEEVES = ("cut", "whole", "none")  # of the bending section
AWAY = np.array([0.0, 1e3, 0.0])  # place of what is not in use [m]: far beyond everything
OUTER = 1.40  # radius of sleeve and sheath

_PALER = 2.1
_CAP, _INNER, _VERTEBRA, _CORE, _WIRE = 1.46, 1.26, 0.94, 0.42, 0.19
_SLEEVE_OPENING, _SHEATH_OPENING = math.radians(76), math.radians(72)  # half of what is cut out
_TOWARDS_VIEWER, _UPWARDS = math.pi, math.pi / 2
_WHEEL_GAP, _WHEEL_THICK = 1.4, 0.24  # between sheath and wheel, and across its rim, in radii of the pulley
_HOLES = 5


class DrawnEndoscope:
    """Endoscope that is drawn, and only drawn."""

    def __init__(
        self,
        preset: Preset,
        scene: str = "bench",
        sleeve: str = "cut",
        *,
        pale: bool = False,
        more: Callable[[mujoco.MjSpec], None] | None = None,
    ) -> None:
        """Build the model of a scene of `SCENES` and a sleeve of `SLEEVES`.

        It is `pale` for lighter materials on a dark background; `more` adds what else there is.
        """
        self.preset = preset
        self._overview = scene == "overview"
        spec = mujoco.MjSpec.from_file(str(assets_folder() / "stage.xml"))
        section, sheath = add_bodies(spec, preset)
        add_section(spec, preset, section, sleeve)
        add_cap(spec, preset)
        add_sheath(spec, preset, sheath, opened=self._overview)
        if self._overview:
            add_station(spec, preset)
        if scene == "lumen":
            add_lumen(spec, preset.section_length)
            _light_by_the_tip(spec, preset)
        for name in ("sleeve", "sheath", "cap", "motor") if pale else ():
            material = spec.material(name)
            material.rgba = [*(_PALER * material.rgba[:3]), 1.0]
        if more is not None:
            more(spec)
        self.model = spec.compile()
        self._data = mujoco.MjData(self.model)
        model = self.model
        self._body = {model.body(i).name: int(model.body_mocapid[i]) for i in range(1, model.nbody)}
        names = [(index, model.skin(index).name) for index in range(model.nskin)]
        wires = [(index, name) for index, name in names if name.startswith("wire_")]
        self._skins = {
            (WIRES.index(name[5]), int(name[6:])): index for index, name in wires
        }  # of each length
        self.place("base", np.zeros(3), np.eye(3))
        self.place_sheath(sheath_frames(preset, 0.0))

    def stand(self, links: Frames, index: int) -> None:
        """Set the pose of the bending section to that of a sample, as in `link_frames`."""
        for number in range(self.preset.vertebrae):
            self.place(f"link_{number}", links.position[index, number], links.rotation[index, number])

    def place_sheath(self, frames: Frames) -> None:
        """Bend the sheath along its frames, from the base to the pulley, as in `sheath_frames`."""
        for number in range(SHEATH_BONES + 1):
            self.place(f"sheath_{number}", frames.position[number], frames.rotation[number])
        if self._overview:
            self.place("station", frames.position[-1], frames.rotation[-1])

    def turn_wheel(self, plane: int, pull: float, sheath: Frames) -> None:
        """Turn the wheel of a bending plane to a pulling distance [m], at the pulley's end of a sheath."""
        rotation = sheath.rotation[-1]
        centre = sheath.position[-1] + rotation @ np.array(wheel_place(self.preset, plane))
        across = np.eye(3) if plane == 0 else Rotation.from_rotvec([np.pi / 2, 0, 0]).as_matrix()
        # Pulling wire a, which leaves the wheel's upper side, moves that side backwards.
        turn = Rotation.from_rotvec([0.0, -pull / self.preset.pulley_radius, 0.0]).as_matrix()
        self.place(f"wheel_{plane}", centre, rotation @ across @ turn)

    def paint_wires(self, colours: Array) -> None:
        """Colour each length of each wire, pulley to tip: (wires, lengths or 1, 3) from 0 to 1."""
        for (wire, element), skin in self._skins.items():
            length = min(element, colours.shape[1] - 1)
            self.model.skin_rgba[skin, :3] = colours[wire, length]
        if self._overview:
            for wire in range(self.preset.wires):
                self.model.geom(f"wire_{WIRES[wire]}").rgba[:3] = colours[wire, 0]

    def open_canvas(self, width: int, height: int) -> None:
        """Open the renderer for pictures of a size."""
        self._canvas = Canvas(self.model, width, height)

    def draw(self, view: View) -> Layer:
        """Return a picture as in `Canvas.draw`; the canvas must have been opened."""
        mujoco.mj_kinematics(self.model, self._data)
        mujoco.mj_camlight(self.model, self._data)
        return self._canvas.draw(self._data, view)

    def place(self, name: str, position: Array, rotation: Array) -> None:
        """Place a body that is moved by nothing else: its origin (3,) [m] and its axes (3, 3), as columns."""
        body = self._body[name]
        self._data.mocap_pos[body] = position
        self._data.mocap_quat[body] = Rotation.from_matrix(rotation).as_quat(scalar_first=True)

    def hide(self) -> None:
        """Put every body out of sight; those that are placed from then on are seen again."""
        self._data.mocap_pos[:] = AWAY


def _light_by_the_tip(spec: mujoco.MjSpec, preset: Preset) -> None:
    """Switch the lights of the bench off, and light the scene in front of the tip."""
    for light in list(spec.lights):
        light.active = False
    spec.visual.headlight.active = 0
    body = spec.body(f"link_{preset.vertebrae - 1}")
    link = preset.section_length / preset.vertebrae
    far = 1.0 / preset.section_length
    for name, spread, strength in (("spot", 7.0, 0.95), ("glow", 1.2, 0.62)):
        body.add_light(
            name=f"tip_{name}",
            pos=[link, 0.0, 0.0],
            dir=[1.0, 0.0, 0.0],
            cutoff=80,
            exponent=spread,
            attenuation=[0.55, 0.40 * far, 0.40 * far**2],
            diffuse=[strength, 0.97 * strength, 0.93 * strength],
            ambient=[0.03, 0.02, 0.02],
            specular=[0.5, 0.5, 0.5],
            castshadow=False,
        )


def cap_length(preset: Preset) -> float:
    """Return how far the cap reaches beyond the end of the last link [m]."""
    return 0.5 * preset.wire_offset


def add_bodies(spec: mujoco.MjSpec, preset: Preset) -> tuple[Bones, Bones]:
    """Add the bodies that are placed for each picture; return the bones of the section and of the sheath.

    Those of the section are base, links and tip; those of the sheath go from the pulley to the base.
    """
    count, length = preset.vertebrae, drawn_sheath_length(preset)
    link = preset.section_length / count
    origin = np.array([0.0, *(link * np.arange(count))])
    middle = np.array([-0.5 * link, *(link * (np.arange(count) + 0.5))])
    section = Bones(("base", *(f"link_{index}" for index in range(count))), origin, middle)
    along = np.linspace(-length, 0.0, SHEATH_BONES + 1)
    sheath = Bones(tuple(f"sheath_{index}" for index in range(SHEATH_BONES, -1, -1)), along, along)
    for bones in (section, sheath):
        for name, place in zip(bones.names, bones.origin, strict=True):
            spec.worldbody.add_body(name=name, pos=[place, 0, 0], mocap=True)
    return section, sheath


def add_section(spec: mujoco.MjSpec, preset: Preset, bones: Bones, sleeve: str) -> None:
    """Add the sleeve of the bending section, and where it is not whole, what is in it."""
    radius, link, length = preset.wire_offset, preset.section_length / preset.vertebrae, preset.section_length
    if sleeve != "whole":
        _add_inside(spec, preset, bones)
    if sleeve == "none":
        return
    start, end = min(1.2 * radius, 0.1 * length), length - max(3.0 * radius, 0.1 * length)
    corner = min(1.6 * radius, 0.2 * length)
    along = _window_rings(-0.5 * link, start, end, length, corner, length / 48)
    opening = np.zeros(len(along))
    if sleeve == "cut":
        opening = window(along, start, end, _SLEEVE_OPENING, corner)
    _shell(spec, "sleeve", along, opening, _TOWARDS_VIEWER, preset, bones)


def _add_inside(spec: mujoco.MjSpec, preset: Preset, bones: Bones) -> None:
    radius, link = preset.wire_offset, preset.section_length / preset.vertebrae
    length, count = preset.section_length, preset.vertebrae
    for index in range(count):
        body = spec.body(f"link_{index}")
        _cylinder(body, 0.22 * link, 0.78 * link, _VERTEBRA * radius, "vertebra")
        for start, end in ((0.16, 0.22), (0.78, 0.84)):
            _cylinder(body, start * link, end * link, 0.93 * _VERTEBRA * radius, "vertebra")
    along = rings([-0.5 * link, 0.0, length], max(link / 3, length / 60))
    add_skin(spec, "core", round_tube(along, _CORE * radius, 10), bones, "core")
    for wire in WIRES[: preset.wires]:
        y, z = WIRE_PLACES[wire]
        tube = round_tube(along, _WIRE * radius, 8, (y * radius, z * radius))
        add_skin(spec, f"wire_{wire}{preset.sheath_elements}", tube, bones, "wire")


def add_cap(spec: mujoco.MjSpec, preset: Preset) -> None:
    """Add the rigid tip: cap, lens, two windows of light, and the mouth of the working channel."""
    radius, link = preset.wire_offset, preset.section_length / preset.vertebrae
    body = spec.body(f"link_{preset.vertebrae - 1}")
    front = link + cap_length(preset)
    back = link - max(2.0 * radius, 0.6 * link)
    chamfer = 0.22 * radius
    profile = [
        (back, 0.0),
        (back, OUTER - 0.04),
        (back + 0.05 * radius, _CAP),
        (front - chamfer, _CAP),
        (front - 0.3 * chamfer, _CAP - 0.13),
        (front, _CAP - 0.26),
    ]
    _revolved(spec, body, "cap", [(x, share * radius) for x, share in profile], "cap")
    _cylinder(body, front - chamfer, front + 0.02 * radius, (_CAP - 0.27) * radius, "face")
    _cylinder(body, front, front + 0.04 * radius, 0.47 * radius, "vertebra", (0.0, 0.46 * radius))
    dome = body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=[0.16 * radius, 0.40 * radius, 0.40 * radius]
    )
    dome.pos, dome.material = [front + 0.04 * radius, 0.0, 0.46 * radius], "lens"
    _cylinder(body, front, front + 0.03 * radius, 0.36 * radius, "vertebra", (-0.34 * radius, -0.58 * radius))
    _cylinder(body, front, front + 0.05 * radius, 0.31 * radius, "channel", (-0.34 * radius, -0.58 * radius))
    for y, z in ((-0.78, 0.24), (0.78, 0.24), (0.46, -0.66)):
        _cylinder(body, front, front + 0.05 * radius, 0.18 * radius, "light", (y * radius, z * radius))


def add_sheath(spec: mujoco.MjSpec, preset: Preset, bones: Bones, *, opened: bool) -> None:
    """Add the sheath, and if it is opened, the wires in it: a skin for each length between its elements."""
    radius, length = preset.wire_offset, drawn_sheath_length(preset)
    start, end, corner = -0.97 * length, -0.03 * length, 2.0 * radius
    along = rings([-length, 0.0], length / 4)  # straight
    opening = np.zeros(len(along))
    if opened:
        along = _window_rings(-length, start, end, 0.0, corner, length / (2 * SHEATH_BONES))
        opening = window(along, start, end, _SHEATH_OPENING, corner)
        elements = preset.sheath_elements
        for wire in WIRES[: preset.wires]:
            y, z = WIRE_PLACES[wire]
            for element in range(elements):
                start, end = (-length * (1 - share / elements) for share in (element, element + 1))
                piece = rings([start, end], length / (2 * SHEATH_BONES))
                tube = round_tube(piece, _WIRE * radius, 6, (y * radius, z * radius))
                add_skin(spec, f"wire_{wire}{element}", tube, bones, "wire")
        add_skin(spec, "sheath_core", round_tube(along, _CORE * radius, 8), bones, "core")
    _shell(spec, "sheath", along, opening, _UPWARDS, preset, bones)
    _cylinder(spec.body("base"), -1.4 * radius, 0.7 * radius, _CAP * radius, "cap")  # over the joint


def add_station(spec: mujoco.MjSpec, preset: Preset) -> None:
    """Add the end of the sheath, and for each bending plane a wheel on its motor, with the wires to it."""
    station = spec.worldbody.add_body(name="station", mocap=True)
    behind = 1.0 if math.cos(preset.sheath_bend) >= 0 else -1.0  # motors stand behind the wheels
    radius, wheel = preset.wire_offset, preset.pulley_radius
    _cylinder(station, -0.16 * wheel, 0.5 * wheel, 1.35 * OUTER * radius, "motor")
    for plane in range(preset.bending_planes):
        centre = np.array(wheel_place(preset, plane))
        axis = np.array([[0.0, behind, 0.0], [0.0, 0.0, -1.0]][plane])
        body = spec.worldbody.add_body(name=f"wheel_{plane}", mocap=True)
        _add_wheel(body, wheel)
        start, end = (centre + share * wheel * axis for share in (0.5 * _WHEEL_THICK, 1.5))
        _between(station, start, end, 0.62 * wheel, "motor")
        for wire in WIRES[2 * plane : 2 * plane + 2]:
            across = np.array([0.0, *WIRE_PLACES[wire]])
            ends = radius * across, centre + (wheel - 0.5 * _WIRE * radius) * across
            _between(station, *ends, _WIRE * radius, "wire", "CAPSULE", name=f"wire_{wire}")


def wheel_place(preset: Preset, plane: int) -> tuple[float, float, float]:
    """Return the centre of the wheel of a bending plane, in the frame of the station [m]."""
    return -(_WHEEL_GAP + 2.7 * plane) * preset.pulley_radius - preset.pulley_radius, 0.0, 0.0


def _add_wheel(body: mujoco.MjsBody, radius: float) -> None:
    """Add a wheel about the y axis of its body: rims around a groove, holes, and a mark to see its turn."""
    half = 0.5 * _WHEEL_THICK * radius

    def disc(start: float, end: float, size: float, material: str, x: float = 0, z: float = 0) -> None:
        _between(body, (x, start, z), (x, end, z), size, material)

    disc(-half, -0.4 * half, 1.08 * radius, "wheel")
    disc(-0.4 * half, 0.4 * half, 0.98 * radius, "vertebra")
    disc(0.4 * half, half, 1.08 * radius, "wheel")
    disc(-1.5 * half, 1.5 * half, 0.2 * radius, "motor")
    for hole in range(_HOLES):
        angle = 2 * np.pi * (hole + 0.5) / _HOLES
        x, z = 0.6 * radius * np.cos(angle), 0.6 * radius * np.sin(angle)
        disc(-1.1 * half, 1.1 * half, 0.2 * radius, "mark", x, z)
    for side in (-1.05, 1.05):
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[0.0, side * half, 0.90 * radius],
            size=[0.045 * radius, 0.1 * half, 0.17 * radius],
            rgba=[0.75, 0.13, 0.10, 1],
        )


def _window_rings(
    first: float, start: float, end: float, last: float, corner: float, spacing: float
) -> Array:
    """Return places of rings, dense where an opening from `start` to `end` has its round corners [m]."""
    bow = corner * (1 - np.cos(np.linspace(0, np.pi / 2, 7)))
    stops = [first, *(start + bow[:-1]), start + corner, end - corner, *(end - bow[-2::-1]), last]
    return rings(stops, spacing)


def _shell(
    spec: mujoco.MjSpec, name: str, along: Array, opening: Array, towards: float, preset: Preset, bones: Bones
) -> None:
    outer, inner = (np.full(len(along), share * preset.wire_offset) for share in (OUTER, _INNER))
    seam = towards if opening.any() else towards + math.pi  # of a whole one, out of sight
    wall, cut = open_shell(along, outer, inner, opening, 24, seam)
    add_skin(spec, name, wall, bones, name)
    add_skin(spec, f"{name}_cut", cut, bones, "cut")


def _between(
    body: mujoco.MjsBody,
    start: Sequence[float] | Array,
    end: Sequence[float] | Array,
    radius: float,
    material: str,
    shape: str = "CYLINDER",
    name: str = "",
) -> None:
    body.add_geom(
        name=name,
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{shape}"),
        fromto=[*start, *end],
        size=[radius, 0, 0],
        material=material,
    )


def _cylinder(
    body: mujoco.MjsBody,
    start: float,
    end: float,
    radius: float,
    material: str,
    place: tuple[float, float] = (0.0, 0.0),
) -> None:
    _between(body, (start, *place), (end, *place), radius, material)


def _revolved(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, profile: list[tuple[float, float]], material: str
) -> None:
    """Add a solid of revolution about x, closed at its ends: `profile` is (x, radius) from back to front."""
    sides = 40
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    points = [[x, r * np.cos(a), r * np.sin(a)] for x, r in profile for a in angle]
    points += [[profile[-1][0], 0.0, 0.0]]
    last, centre, faces = (len(profile) - 1) * sides, len(points) - 1, []
    for here in range(last):
        right = here + 1 if (here + 1) % sides else here + 1 - sides
        faces += [[here, right, right + sides], [here, right + sides, here + sides]]
    faces += [[last + k, last + (k + 1) % sides, centre] for k in range(sides)]
    spec.add_mesh(
        name=name,
        uservert=np.ravel(points).tolist(),
        userface=np.ravel(faces).astype(int).tolist(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, material=material)


@dataclasses.dataclass(frozen=True)
class Plate:
    """Flat plate with a printed front."""

    name: str  # of it, and of its body where it has one of its own
    picture: NDArray[np.uint8]  # (height, width) grey levels of its front
    size: tuple[float, float]  # width and height [m]
    body: str = ""  # that carries it; empty: one of its own, which is placed for each picture
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of its front, in the frame of the body [m]
    right: tuple[float, float, float] = (1.0, 0.0, 0.0)  # unit vector along its rows, in the same frame
    down: tuple[float, float, float] = (0.0, 0.0, -1.0)  # along its columns; right x down points into it

    def corners(self) -> Array:
        """Return the corners of its front (4, 3) in the body's frame, from the upper left clockwise [m]."""
        right, down = np.array(self.right) * self.size[0] / 2, np.array(self.down) * self.size[1] / 2
        around = np.array([-right - down, right - down, right + down, -right + down])
        corners: Array = np.array(self.centre) + around
        return corners


def add_plate(spec: mujoco.MjSpec, plate: Plate) -> None:
    """Add a plate; its front has no gloss."""
    name = plate.body or plate.name
    if not plate.body:
        spec.worldbody.add_body(name=name, pos=AWAY.tolist(), mocap=True)
    height, width = plate.picture.shape
    texture = spec.add_texture(
        name=plate.name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=3
    )
    texture.data = np.repeat(plate.picture[..., None], 3, axis=-1).tobytes()
    material = spec.add_material(name=plate.name, specular=0.0, shininess=0.0, rgba=[1, 1, 1, 1])
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = plate.name
    front = plate.corners()
    skin = spec.add_skin(name=plate.name, material=plate.name)
    skin.vert = front.ravel().tolist()
    skin.texcoord = [0, 0, 1, 0, 1, 1, 0, 1]
    skin.face = [0, 3, 2, 0, 2, 1]
    skin.bodyname, skin.vertid, skin.vertweight = [name], [[0, 1, 2, 3]], [[1.0] * 4]
    skin.bindpos, skin.bindquat = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]


def add_rod(spec: mujoco.MjSpec, name: str, radius: float, length: float) -> None:
    """Add a dark rod along the x axis of a body of its own: an instrument that passes before the cameras."""
    body = spec.worldbody.add_body(name=name, pos=AWAY.tolist(), mocap=True)
    _between(body, (-length / 2, 0, 0), (length / 2, 0, 0), radius, "motor", "CAPSULE")
