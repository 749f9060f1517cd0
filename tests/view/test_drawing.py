"""What the viewer draws: poses of the shapes, and curves that are valid, bounded and steady."""

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from twin.preset import load_preset
from twin.view import Columns, Pose
from twin.view.curves import MOST_POINTS, Axis, Curves
from twin.view.shapes import place, place_sheath

PRESET = load_preset("ureteroscope")


def pose(bend_deg: float, force: float = 0.0) -> Pose:
    """A pose with equal hinges."""
    hinges = np.full(PRESET.vertebrae, math.radians(bend_deg) / PRESET.vertebrae)
    return Pose(hinges, np.empty(0), 0.0, force)


def test_a_straight_section_has_length_one_along_x_with_its_wires_around_it():
    placed = place(PRESET, pose(0.0))
    np.testing.assert_allclose(placed.tip.position, [[1.0, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(placed.links.position[0], [0.5 / PRESET.vertebrae, 0.0, 0.0], atol=1e-12)
    assert len(placed.wires.position) == 2 * PRESET.vertebrae
    offset = PRESET.wire_offset / PRESET.section_length
    wire_a, wire_b = placed.wires.position.reshape(2, PRESET.vertebrae, 3)
    np.testing.assert_allclose(
        wire_a - wire_b, np.tile([0, 0, 2 * offset], (PRESET.vertebrae, 1)), atol=1e-12
    )


def test_a_bent_tip_points_upwards_and_is_pushed_at_right_angles():
    placed = place(PRESET, pose(90.0, 0.5), largest_force_n=1.0)
    turned = Rotation.from_quat(placed.tip.quaternion, scalar_first=True)
    np.testing.assert_allclose(turned.apply([1.0, 0.0, 0.0]), [[0.0, 0.0, 1.0]], atol=1e-12)
    tail, head = placed.force
    np.testing.assert_allclose(head, placed.tip.position[0])
    np.testing.assert_allclose(head - tail, [-0.25, 0.0, 0.0], atol=1e-12)  # towards more bend


def test_the_sheath_turns_by_its_bend_from_the_end_of_the_section():
    straight, bent = place_sheath(PRESET, 0.0), place_sheath(PRESET, math.pi)
    assert (np.diff(straight.position[:, 0]) < 0).all()
    last = Rotation.from_quat(bent.quaternion[-1], scalar_first=True)
    np.testing.assert_allclose(last.apply([1.0, 0.0, 0.0]), [-1.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(bent.position[0], straight.position[0], atol=1e-6)


def trail(count: int, wires: int = 2) -> np.ndarray:
    """A slow sine, without an estimate."""
    time = np.arange(count) / 30
    made = np.full((count, Columns.TENSIONS_N + 2 * wires), np.nan)
    made[:, Columns.TIME_S] = time
    made[:, Columns.PULL_MM], made[:, Columns.BEND_DEG] = np.sin(time), 30 * np.sin(time - 0.3)
    made[:, Columns.TENSIONS_N :] = 5.0
    return made


@pytest.mark.parametrize("count", [1, 2, 40, 5000])
@pytest.mark.parametrize("wires", [0, 2])
def test_curves_are_valid_within_the_drawing_and_have_few_points(count, wires):
    svg = ElementTree.fromstring(Curves(1, wires, "", 4.0).svg(trail(count, wires)))
    width, height = (float(of) for of in svg.attrib["viewBox"].split()[2:])
    lines = [line.attrib["points"].split() for line in svg.iter("polyline")]
    assert len(lines) == 3 + 2 * wires  # loop, truth, no estimate; two ends of each wire
    for points in lines:
        assert len(points) <= MOST_POINTS + 2
        for point in points:
            x, y = map(float, point.split(","))
            assert 0 <= x <= width
            assert 0 <= y <= height
    assert ("Tension" in "".join(svg.itertext())) == bool(wires)


def test_an_estimate_is_drawn_with_its_interval_and_its_name_as_text():
    made = trail(40)
    made[10:, Columns.ESTIMATE_DEG] = 3.0
    made[20:, [Columns.LOW_DEG, Columns.HIGH_DEG]] = 1.0, 5.0
    svg = ElementTree.fromstring(Curves(1, 2, "<RAM> & more", 4.0).svg(made))
    assert "<RAM> & more, 95 %" in "".join(svg.itertext())
    (band,) = svg.iter("polygon")
    assert len(band.attrib["points"].split()) == 2 * 20


def test_an_axis_has_round_steps_and_never_shrinks():
    axis = Axis(20.0)
    assert axis.ticks() == [-20, -10, 0, 10, 20]
    axis.grow(np.array([np.nan, 87.0, -3.0]))
    assert (axis.low, axis.high, axis.step) == (-50.0, 100.0, 50.0)
    axis.grow(np.array([1.0]))
    assert (axis.low, axis.high) == (-50.0, 100.0)
