"""The drawn endoscope stands where MuJoCo's own does, its tubes are smooth, and alpha is a share."""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from twin.mechanics.kinematics import link_frames
from twin.physics import choose_backend
from twin.physics.drawing.canvas import Canvas, View
from twin.physics.drawing.drawn import SCENES, SLEEVES, DrawnEndoscope
from twin.physics.drawing.surfaces import (
    Bones,
    add_skin,
    drawn_sheath_length,
    open_shell,
    rings,
    round_tube,
    sheath_frames,
    window,
)
from twin.preset.file import load_preset

mujoco = pytest.importorskip("mujoco")
needs_gl = pytest.mark.skipif(choose_backend() == "disable", reason="nothing here draws without a screen")
PRESET = load_preset("ureteroscope")
FRONT = View(
    np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), 0.05, parallel=True
)


@settings(max_examples=30, deadline=None)
@given(st.floats(0, 8 * np.pi))
def test_the_sheath_turns_by_its_bend_and_keeps_its_length(bend):
    frames = sheath_frames(PRESET, bend)
    assert np.linalg.norm(np.diff(frames.position, axis=0), axis=1).sum() == pytest.approx(
        drawn_sheath_length(PRESET), rel=0.07 if bend > 3 * np.pi else 0.02
    )  # chords are shorter than arcs
    turns = Rotation.from_matrix(np.swapaxes(frames.rotation[:-1], 1, 2) @ frames.rotation[1:])
    assert np.linalg.norm(turns.as_rotvec(), axis=1).sum() == pytest.approx(bend, abs=1e-6)
    np.testing.assert_allclose(frames.position[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(frames.rotation[0], np.eye(3), atol=1e-12)


def bent_vertices(radius: float, bend: float, links: int = 12, length: float = 0.04) -> np.ndarray:
    """Vertices of a tube as MuJoCo's skin bends them."""
    spec = mujoco.MjSpec()
    link = length / links
    names = tuple(f"link_{k}" for k in range(links))
    origin = link * np.arange(links)
    for name, x in zip(names, origin, strict=True):
        spec.worldbody.add_body(name=name, pos=[x, 0, 0], mocap=True)
    tube = round_tube(np.linspace(0, length, 60), radius, 12)
    add_skin(spec, "tube", tube, Bones(names, origin, origin + link / 2), "")
    model = spec.compile()
    data = mujoco.MjData(model)
    frames = link_frames(np.full((1, links), bend / links), np.empty(0), length)
    for k in range(links):
        data.mocap_pos[k] = frames.position[0, k]
        data.mocap_quat[k] = Rotation.from_matrix(frames.rotation[0, k]).as_quat(scalar_first=True)
    mujoco.mj_kinematics(model, data)
    scene = mujoco.MjvScene(model, 10)
    every, option, camera = mujoco.mjtCatBit.mjCAT_ALL.value, mujoco.MjvOption(), mujoco.MjvCamera()
    mujoco.mjv_updateScene(model, data, option, None, camera, every, scene)
    return np.array(scene.skinvert).reshape(-1, 13, 3)


@pytest.mark.parametrize("bend_deg", [0.0, 60.0, 150.0, -90.0])
def test_a_tube_bends_smoothly_and_keeps_its_thickness(bend_deg):
    """Its centre line is an arc: that of the links' middles, at half a hinge from theirs."""
    radius, length = 1.4e-3, 0.04
    vertices = bent_vertices(radius, np.radians(bend_deg))
    centre = vertices[:, :-1].mean(axis=1)
    away = np.linalg.norm(vertices - centre[:, None], axis=-1)
    np.testing.assert_allclose(away, radius, rtol=0.06)
    steps = np.diff(centre, axis=0)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(length, rel=0.01)
    heading = np.degrees(np.unwrap(np.arctan2(steps[:, 2], steps[:, 0])))
    hinge_deg = abs(bend_deg) / 12  # what a chain of rigid links would turn by at once
    assert np.abs(np.diff(heading)).max() <= max(0.6 * hinge_deg, 0.01)


def test_a_cut_shell_is_closed_but_for_its_window_and_its_normals_point_outwards():
    along = rings([0.0, 0.01], 0.0005)
    opening = window(along, 0.002, 0.008, 1.2, 0.001)
    assert opening[0] == opening[-1] == 0
    assert opening.max() == pytest.approx(1.2)
    whole = np.full(len(along), 1.0)
    wall, cut = open_shell(along, whole, 0.9 * whole, opening, 24, np.pi)
    corners = wall.vertices[wall.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middle = corners.mean(axis=1)
    outwards = (normal[:, 1:] * middle[:, 1:]).sum(axis=1)
    outer = np.arange(len(corners)) < len(corners) / 2
    sound = np.linalg.norm(normal, axis=1) > 1e-12
    assert (outwards[outer & sound] > 0).all()
    assert (outwards[~outer & sound] < 0).all()
    inside = (middle[:, 0] > 0.0035) & (middle[:, 0] < 0.0065)
    angle = np.arctan2(middle[inside, 2], -middle[inside, 1])
    assert np.abs(angle).min() > 1.1  # nothing is in the window
    assert len(cut.faces) > 4 * len(along)


@needs_gl
def test_alpha_is_the_share_of_a_pixel_that_is_covered():
    """The picture of a sphere has the area of a disc, edges counted by their share."""
    spec = mujoco.MjSpec()
    spec.visual.quality.numslices, spec.visual.quality.numstacks = 64, 64
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.03, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    layer = Canvas(model, 200, 160).draw(data, FRONT)
    area = layer[..., 3].sum() / 255 / (80 / 0.05) ** 2
    assert area == pytest.approx(np.pi * 0.03**2, rel=0.01)
    assert set(np.unique(layer[..., 3])) - {0, 255}  # edges are smooth
    assert (layer[..., :3].max(axis=-1) <= layer[..., 3]).all()  # colours are multiplied by alpha


@needs_gl
@settings(max_examples=12, deadline=None)
@given(
    st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-0.02, 0.02)),
    st.booleans(),
    st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
)
def test_a_point_is_drawn_where_it_is_projected(place, parallel, shift):
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[5e-4, 0, 0], pos=place)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    forward = np.array([0.2, 0.95, -0.1])
    forward /= np.linalg.norm(forward)
    up = np.array([0.0, 0.0, 1.0]) - forward[2] * forward
    view = View(-0.2 * forward, forward, up / np.linalg.norm(up), 0.05 if parallel else 0.25, parallel, shift)
    layer = Canvas(model, 320, 240).draw(data, view)
    weight = layer[..., 3].astype(float)
    rows, columns = np.mgrid[:240, :320] + 0.5
    found = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
    np.testing.assert_allclose(found, view.project(np.array(place), 320, 240), atol=0.35)


@needs_gl
@pytest.mark.parametrize(("scene", "sleeve"), zip(SCENES, SLEEVES, strict=True))
def test_every_scene_is_drawn_the_same_each_time(scene, sleeve):
    frames = link_frames(np.full((1, PRESET.vertebrae), 0.05), np.empty(0), PRESET.section_length)
    layers = []
    for _ in range(2):
        drawn = DrawnEndoscope(PRESET, scene, sleeve)
        drawn.stand(frames, 0)
        drawn.open_canvas(120, 90)
        layers.append(drawn.draw(FRONT))
    np.testing.assert_array_equal(*layers)
    assert layers[0][..., 3].any()


def test_where_no_library_is_the_error_names_the_package():
    """The loader finds no library at all; the choice falls on none."""
    code = (
        "import ctypes.util; ctypes.util.find_library = lambda name: None\n"
        "import numpy as np\n"
        "from twin.preset.file import load_preset\n"
        "from twin.rendering.cameras import Portrait\n"
        "try: Portrait(load_preset('ureteroscope'))\n"
        "except OSError as error: print(error)\n"
    )
    env = {name: value for name, value in os.environ.items() if "GL" not in name}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert done.stdout.count("\n") == 1
    assert "apt-get install libegl1 libgl1-mesa-dri" in done.stdout
