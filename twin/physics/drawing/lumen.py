"""Lumen that the endoscope looks into: a cavity with folds, calyces and vessels around it."""

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from twin.physics.drawing.surfaces import Faces, grid_faces

Array = NDArray[np.float64]

_SEED = 7  # of its shape and its vessels: there is one lumen
_RADIUS, _CENTRE = 1.18, 0.5  # in lengths of the bending section
_ROWS, _COLUMNS = 96, 192
_TEXTURE = (768, 1536)
_PINK, _PALE, _VESSEL = np.array([[0.80, 0.40, 0.35], [0.93, 0.62, 0.53], [0.55, 0.10, 0.12]])
_CALYCES = 11


def add_lumen(spec: mujoco.MjSpec, section_length: float) -> None:
    """Add the cavity, seen from inside; it holds every pose of a section of this length."""
    rng = np.random.default_rng(_SEED)
    polar = np.linspace(0.0, np.pi, _ROWS + 1)
    around = np.linspace(0.0, 2 * np.pi, _COLUMNS + 1)
    grid, turn = np.meshgrid(polar, around, indexing="ij")
    # The poles, where a texture is drawn together, lie across the bending plane, out of sight.
    way = np.stack([np.sin(grid) * np.cos(turn), np.cos(grid), np.sin(grid) * np.sin(turn)], axis=-1)
    vertices = way * (_RADIUS * _relief(way, rng) * section_length)[..., None]
    faces = grid_faces(*grid.shape)[:, ::-1]
    spec.add_mesh(
        name="lumen",
        uservert=vertices.ravel().tolist(),
        userface=faces.ravel().tolist(),
        usernormal=_inward_normals(vertices.reshape(-1, 3), faces).ravel().tolist(),
        usertexcoord=np.stack([turn / (2 * np.pi), grid / np.pi], axis=-1).ravel().tolist(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    height, width = _TEXTURE
    texture = spec.add_texture(
        name="mucosa", type=mujoco.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=3
    )
    texture.data = _mucosa(rng).tobytes()
    material = spec.add_material(name="mucosa", specular=0.35, shininess=0.55, rgba=[1, 1, 1, 1])
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "mucosa"
    spec.worldbody.add_geom(
        name="lumen",
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname="lumen",
        material="mucosa",
        pos=[_CENTRE * section_length, 0.0, 0.0],
    )


def _relief(way: Array, rng: np.random.Generator) -> Array:
    """Return the distance of the wall in each direction, in radii: folds, and the mouths of calyces."""
    relief = np.ones(way.shape[:-1])
    for _ in range(10):
        wave, phase = rng.normal(size=3), rng.uniform(0, 2 * np.pi)
        relief += 0.018 * np.sin(rng.uniform(4, 9) * (way @ wave) + phase)
    for _ in range(_CALYCES):
        mouth = rng.normal(size=3) * [1.0, 0.45, 1.0]
        mouth /= np.linalg.norm(mouth)
        away = np.arccos(np.clip(way @ mouth, -1, 1)) / rng.uniform(0.16, 0.26)
        relief += rng.uniform(0.35, 0.6) / (1 + np.exp(7 * (away - 1)))  # a tube, that opens outwards
        relief -= 0.07 * np.exp(-((away - 1.35) ** 2) / 0.06)  # and the lip around it
    return relief


def _inward_normals(vertices: Array, faces: Faces) -> Array:
    corners = vertices[faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for corner in faces.T:
        np.add.at(normals, corner, flat)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    inward: Array = np.where(size > 0, normals / np.maximum(size, 1e-30), -vertices)
    return inward


def _mucosa(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return a picture of mucosa, (height, width, 3): pale and pink patches under branching vessels."""
    height, width = _TEXTURE
    patches = gaussian_filter(rng.standard_normal(_TEXTURE), 22, mode="wrap")
    patches = np.clip(0.5 + 0.25 * patches / patches.std(), 0, 1)[..., None]
    colour = _PINK + patches * (_PALE - _PINK)
    grain = gaussian_filter(rng.standard_normal(_TEXTURE), 1.2, mode="wrap")
    colour = colour * (1 + 0.03 * grain / grain.std())[..., None]
    vessels = np.zeros(_TEXTURE)
    for _ in range(170):
        start = rng.uniform([0.12 * height, 0], [0.88 * height, width])
        _grow(vessels, start, rng.uniform(0, 2 * np.pi), rng.uniform(1.0, 2.2), rng)
    covered = np.clip(gaussian_filter(vessels, 0.9, mode="wrap"), 0, 1)[..., None]
    colour = colour + 0.75 * covered * (_VESSEL - colour)
    picture: NDArray[np.uint8] = (255 * np.clip(colour, 0, 1)).astype(np.uint8)
    return picture


def _grow(vessels: Array, start: Array, heading: float, width: float, rng: np.random.Generator) -> None:
    """Draw one vessel and its branches, each thinner than what it leaves."""
    height, across = vessels.shape
    place = np.array(start, dtype=float)
    for step in range(int(30 * width)):
        heading += rng.normal(0, 0.16)
        place += 2.0 * np.array([np.sin(heading), np.cos(heading)])
        thick = width * (1 - step / (34 * width))
        reach = int(np.ceil(thick))
        rows = np.arange(int(place[0]) - reach, int(place[0]) + reach + 1)
        columns = np.arange(int(place[1]) - reach, int(place[1]) + reach + 1)
        away = np.hypot(rows[:, None] - place[0], columns[None] - place[1])
        spot = np.clip(thick - away + 0.5, 0, 1) * min(thick, 1.0)
        inside = (rows >= 0) & (rows < height)
        cell = np.ix_(rows[inside], columns % across)
        vessels[cell] = np.maximum(vessels[cell], spot[inside])
        if width > 0.9 and rng.uniform() < 0.035:
            _grow(vessels, place, heading + rng.choice([-1, 1]) * rng.uniform(0.5, 1.1), 0.62 * width, rng)
