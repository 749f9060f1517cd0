"""Drawn endoscope: the parts on their stage, which stand as a record says, before any camera.

It is a model of its own, beside the one that is simulated: it has no joints and no masses, and every part is
placed for each picture.
"""

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from twin.episode import WIRES
from twin.files.assets import assets_folder
from twin.physics.drawing.canvas import Canvas, Layer, View
from twin.physics.drawing.frames import SHEATH_BONES, Frames, sheath_frames
from twin.physics.drawing.lumen import add_lumen
from twin.physics.drawing.parts import (
    add_bodies,
    add_cap,
    add_section,
    add_sheath,
    add_station,
    wheel_place,
)
from twin.physics.drawing.targets import AWAY
from twin.preset.preset import Preset

Array = NDArray[np.float64]

SCENES = ("bench", "overview", "lumen")
"""Surroundings of the section: a straight shaft; sheath and pulleys; a cavity lit by the tip alone."""
_PALER = 2.1


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
        """Build the model.

        Args:
            preset: shape and size.
            scene: one of `SCENES`.
            sleeve: one of `parts.SLEEVES`.
            pale: True for lighter materials, which are seen on a dark background.
            more: adds what else there is to the model.
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
        self._body = {
            self.model.body(index).name: int(self.model.body_mocapid[index])
            for index in range(1, self.model.nbody)
        }
        self._skins = self._wire_skins()
        self.place("base", np.zeros(3), np.eye(3))
        self.place_sheath(sheath_frames(preset, 0.0))

    def stand(self, links: Frames, index: int) -> None:
        """Set the pose of the bending section to that of a sample, as of `frames.link_frames`."""
        for number in range(self.preset.vertebrae):
            self.place(f"link_{number}", links.position[index, number], links.rotation[index, number])

    def place_sheath(self, frames: Frames) -> None:
        """Bend the sheath along its frames, from the base to the pulley, as of `frames.sheath_frames`."""
        for number in range(SHEATH_BONES + 1):
            self.place(f"sheath_{number}", frames.position[number], frames.rotation[number])
        if self._overview:
            self.place("station", frames.position[-1], frames.rotation[-1])

    def turn_wheel(self, plane: int, pull: float, sheath: Frames) -> None:
        """Turn the wheel of a bending plane to a pulling distance [m], at the pulley's end of a sheath.

        Args:
            plane: 0, or 1 for wires c and d.
            pull: distance that wire a, or c, is pulled by [m].
            sheath: frames of the sheath.
        """
        rotation = sheath.rotation[-1]
        centre = sheath.position[-1] + rotation @ np.array(wheel_place(self.preset, plane))
        across = np.eye(3) if plane == 0 else Rotation.from_rotvec([np.pi / 2, 0, 0]).as_matrix()
        # Pulling wire a, which leaves the wheel's upper side, moves that side backwards.
        turn = Rotation.from_rotvec([0.0, -pull / self.preset.pulley_radius, 0.0]).as_matrix()
        self.place(f"wheel_{plane}", centre, rotation @ across @ turn)

    def paint_wires(self, colours: Array) -> None:
        """Colour each length of each wire, pulley to tip.

        Args:
            colours: (wires, lengths, 3) red, green and blue, from 0 to 1; one length paints a whole wire.
        """
        for (wire, element), skin in self._skins.items():
            length = min(element, colours.shape[1] - 1)
            self.model.skin_rgba[skin, :3] = colours[wire, length]
        if self._overview:
            for wire in range(self.preset.wires):
                self.model.geom(f"wire_{WIRES[wire]}").rgba[:3] = colours[wire, 0]

    def open_canvas(self, width: int, height: int) -> None:
        """Open the renderer for pictures of a size.

        Raises:
            OSError: nothing on this system can draw without a screen.
        """
        self._canvas = Canvas(self.model, width, height)

    def draw(self, view: View) -> Layer:
        """Return a picture as of `Canvas.draw`; the canvas must have been opened."""
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

    def _wire_skins(self) -> dict[tuple[int, int], int]:
        """Return the skin of each length of each wire."""
        named = {self.model.skin(index).name: index for index in range(self.model.nskin)}
        return {
            (WIRES.index(name[5]), int(name[6:])): index
            for name, index in named.items()
            if name.startswith("wire_")
        }


def _light_by_the_tip(spec: mujoco.MjSpec, preset: Preset) -> None:
    """Put out the lights of the bench, and light what is before the tip."""
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
