"""What a viewer draws against MuJoCo: /scene moved by /tf must be where the twin's own model is."""

import dataclasses
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from recorded import make_episode, messages
from scipy.spatial.transform import Rotation

from twin.episode import Episode
from twin.physics import Endoscope
from twin.preset.file import load_preset
from twin.recording import write_episode

DIGITS = 1e-6  # of lengths in the model: MJCF holds six
PRESETS = {
    planes: load_preset("ureteroscope").replace(vertebrae=5, bending_planes=planes) for planes in (1, 2)
}
ENDOSCOPES = {planes: Endoscope.from_preset(preset) for planes, preset in PRESETS.items()}
planes_and_angles = st.sampled_from([1, 2]).flatmap(
    lambda planes: st.tuples(st.just(planes), arrays(float, (2, 5), elements=st.floats(-0.6, 0.6)))
)
both = pytest.mark.parametrize("planes", [1, 2])


def posed(planes: int, angles: np.ndarray) -> Episode:
    """Two samples of the same pose, hinges (2, 5), of which the second row needs the second plane."""
    episode = make_episode(samples=2, vertebrae=5, planes=planes)
    lateral = {"lateral_joint_angle": np.tile(angles[1], (2, 1))} if planes == 2 else {}
    metadata = {"preset": PRESETS[planes].to_dict()}
    return dataclasses.replace(episode, joint_angle=np.tile(angles[0], (2, 1)), metadata=metadata, **lateral)


def recorded(episode: Episode) -> tuple[Any, Any]:
    """The messages of /scene and of /tf at the first sample, from a file."""
    with tempfile.TemporaryDirectory() as folder:
        topics = messages(write_episode(Path(folder) / "a.mcap", episode))
    ((_, drawing),) = topics["/scene"]
    return drawing, topics["/tf"][0][1]


def frames(tf: Any) -> dict[str, tuple[np.ndarray, Rotation]]:
    """Position and rotation of each frame in `base`."""
    placed = {"base": (np.zeros(3), Rotation.identity())}
    for frame in tf.transforms:
        origin, turned = placed[frame.parent_frame_id]
        placed[frame.child_frame_id] = (
            origin + turned.apply(vector(frame.translation)),
            turned * quaternion(frame.rotation),
        )
    return placed


def vector(xyz) -> np.ndarray:
    return np.array([xyz.x, xyz.y, xyz.z])


def quaternion(xyzw) -> Rotation:
    parts = [xyzw.x, xyzw.y, xyzw.z, xyzw.w]
    assert np.linalg.norm(parts) == pytest.approx(1, abs=1e-15)
    return Rotation.from_quat(parts)


def world(episode: Episode) -> dict[str, list]:
    """The shapes of /scene in `base`, by kind.

    Each with its frame. Cylinders: centres of both flat faces, radii there; spheres: centre, sizes; lines:
    points, colour.
    """
    drawing, tf = recorded(episode)
    placed, shapes = frames(tf), {"cylinders": [], "spheres": [], "lines": []}
    for entity in drawing.entities:
        origin, turned = placed[entity.frame_id]

        def place(pose, point, origin=origin, turned=turned) -> np.ndarray:
            return origin + turned.apply(vector(pose.position) + quaternion(pose.orientation).apply(point))

        for shape in entity.cylinders:
            assert shape.size.x == shape.size.y
            faces = [place(shape.pose, [0, 0, side * shape.size.z / 2]) for side in (-1, 1)]
            radii = shape.size.x / 2 * np.array([shape.bottom_scale, shape.top_scale])
            shapes["cylinders"].append((entity.frame_id, np.array(faces), radii))
        for shape in entity.spheres:
            shapes["spheres"].append((entity.frame_id, place(shape.pose, [0, 0, 0]), vector(shape.size)))
        for shape in entity.lines:
            points = np.array([place(shape.pose, vector(point)) for point in shape.points])
            shapes["lines"].append((entity.frame_id, points, (shape.color.r, shape.color.g, shape.color.b)))
    return shapes


@settings(max_examples=12, deadline=None)
@given(planes_and_angles)
def test_lens_is_at_the_tip_of_the_twin(pose):
    planes, angles = pose
    ENDOSCOPES[planes].set_pose(*angles[:planes])
    ((frame, centre, size),) = world(posed(planes, angles))["spheres"]
    tip = ENDOSCOPES[planes].tip_position() - ENDOSCOPES[planes].named.data.xpos["vertebra_0"]
    np.testing.assert_allclose(centre, tip, atol=DIGITS * PRESETS[1].section_length)
    assert frame == "vertebra_4"
    assert (size > 0).all()


@settings(max_examples=12, deadline=None)
@given(planes_and_angles)
def test_a_cylinder_spans_each_link_of_the_twin(pose):
    """From each body of MuJoCo to the next, and on to the tip, without a hole in between."""
    planes, angles = pose
    endoscope = ENDOSCOPES[planes]
    endoscope.set_pose(*angles[:planes])
    hinges = [endoscope.named.data.xpos[f"vertebra_{index}"] for index in range(5)]
    ways = np.array([*hinges, endoscope.tip_position()]) - hinges[0]
    drawn = world(posed(planes, angles))["cylinders"]
    for index in range(5):
        own = [faces for frame, faces, _ in drawn if frame == f"vertebra_{index}"]
        spanned = [faces for faces in own if np.allclose(faces, ways[index : index + 2], atol=1e-8)]
        assert len(spanned) == 1
        for faces in own:  # all others lie on the same axis
            assert np.linalg.norm(np.cross(faces - ways[index], ways[index + 1] - ways[index])) < 1e-9


@pytest.mark.parametrize(("planes", "inner", "outer"), [(1, "a", "b"), (2, "a", "b"), (2, "c", "d")])
def test_wire_that_is_pulled_lies_inside_the_bend(planes, inner, outer):
    """The gaps between its pieces at the hinges would close by wire_offset times the bend: it is shorter."""
    angles = np.zeros((2, 5))
    angles[int(inner == "c")] = 0.3
    lines = world(posed(planes, angles))["lines"]
    ends = {}
    for wire in (inner, outer):
        colour = ENDOSCOPES[2].model.ptr.material(f"wire_{wire}").rgba[:3]
        middles = [points.mean(axis=0) for _, points, own in lines if np.allclose(own, colour)]
        ends[wire] = np.linalg.norm(np.diff(middles, axis=0), axis=1).sum()
    chord = 4 * 2 * PRESETS[1].wire_offset * 2 * np.sin(0.15)
    assert ends[outer] - ends[inner] == pytest.approx(chord, rel=1e-9)
