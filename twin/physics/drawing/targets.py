"""Targets for cameras that measure: plates with a printed picture, and what gets in their way."""

import dataclasses

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AWAY = np.array([0.0, 1e3, 0.0])
"""Place of a target that is not in use [m]: behind everything."""


@dataclasses.dataclass(frozen=True)
class Plate:
    """Flat plate with a printed front.

    Attributes:
        name: of it, and of its body where it has one of its own.
        picture: (height, width) grey levels of its front.
        size: width and height [m].
        body: that carries it; empty: one of its own, which is placed for each picture.
        centre: (3,) of its front, in the frame of the body [m].
        right: (3,) unit vector along its rows, in the same frame.
        down: (3,) unit vector along its columns; right x down points into the plate.
    """

    name: str
    picture: NDArray[np.uint8]
    size: tuple[float, float]
    body: str = ""
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    right: tuple[float, float, float] = (1.0, 0.0, 0.0)
    down: tuple[float, float, float] = (0.0, 0.0, -1.0)

    def corners(self) -> Array:
        """Return the corners of its front (4, 3) in the body's frame, from the upper left clockwise [m]."""
        right = np.array(self.right) * self.size[0] / 2
        down = np.array(self.down) * self.size[1] / 2
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
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[-length / 2, 0, 0, length / 2, 0, 0],
        size=[radius, 0, 0],
        material="motor",
    )
