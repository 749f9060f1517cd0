"""Friction that two planes share: isotropic, as Coulomb's law has it; a circle of commands stays round."""

import numpy as np
import pytest
from plain_endoscope import PLAIN

from twin.mechanics.kinematics import link_frames
from twin.preset.file import load_preset, preset_names

T = 0.05  # [s]
PERIOD = 16.0  # [s] of a circle
# Friction that does not depend on the load, and wires that stay taut: nothing but it knows of directions.
DRY = PLAIN.replace(
    name="dry",
    bending_planes=2,
    vertebrae=6,
    section_stiffness=0.05,
    joint_friction=6e-3,
    sheath_friction=0.0,
    sheath_friction_floor=2.0,
    pretension=20.0,
    section_damping=0.0,
    wire_damping=0.0,
)
TIME = np.arange(0, 2.5 * PERIOD, T)


def around(radius: float, start: float) -> tuple[np.ndarray, np.ndarray]:
    """A circle of commands of both planes [m], from an angle [rad]."""
    angle = start + 2 * np.pi * TIME / PERIOD
    return radius * np.cos(angle), radius * np.sin(angle)


def out_of_round(episode) -> float:
    """Largest departure of the tip's last turn from a circle about neutral, as a share of its radius."""
    radius = np.hypot(episode.bend, episode.lateral_bend)[-round(PERIOD / T) :]
    return float(np.abs(radius / radius.mean() - 1).max())


def circled(twin, preset, radius: float, start: float) -> np.ndarray:
    """Position of the tip along the last turn, (N, 3) [m], of a preset that has its plane twice."""
    both = preset.replace(bending_planes=2, lateral_initial_bend=preset.initial_bend)
    pull, lateral = around(radius, start)
    begin = np.linspace(0, 1, round(2 / T))  # straight to where the circle begins
    pull, lateral = np.append(begin * pull[0], pull), np.append(begin * lateral[0], lateral)
    episode = twin.simulate(both, pull, T, lateral_pull=lateral)
    assert np.ptp(episode.bend) > np.radians(20)
    path = link_frames(episode.joint_angle, episode.lateral_joint_angle, both.section_length).position
    return path[-round(PERIOD / T) :, -1]


@pytest.mark.parametrize(
    "start", [0.0, np.pi / 4, 2.0, *(pytest.param(at, marks=pytest.mark.slow) for at in (0.6, np.pi, 5.5))]
)
def test_circle_of_commands_stays_round_whatever_direction_it_starts_in(twin, start):
    pull, lateral = around(2e-3, start)
    episode = twin.simulate(DRY, pull, T, lateral_pull=lateral)
    assert out_of_round(episode) < 0.01
    lag = np.angle((pull + 1j * lateral) / (episode.bend + 1j * episode.lateral_bend))[-round(PERIOD / T) :]
    assert lag.min() > np.radians(5)  # friction there is


@pytest.mark.parametrize("name", preset_names())
def test_circle_of_every_preset_stays_round(twin, name):
    """Along 2.5 mm the ureteroscope is the least round: wires turn slack, and pull in one plane alone."""
    circles = {"ureteroscope": [(1e-3, 0.3), (2.5e-3, 2.5), (4e-3, 0.0)], "vio_com": [(8e-3, 0.3)]}[name]
    if twin.name == "mujoco":
        circles = circles[:1]  # of each radius on the reduced twin alone, which agrees with it
    for radius, start in circles:
        tip = circled(twin, load_preset(name), radius, start)
        reach = np.hypot(*(tip - tip.mean(axis=0)).T[1:])
        assert np.abs(reach / reach.mean() - 1).max() < 0.03


def test_motion_in_one_plane_lets_the_other_one_go(twin):
    """A bend held back by friction in one plane comes loose as the other one slides far enough."""
    there, cycles = np.linspace(0, 2e-3, 80), 1.5e-3 * np.sin(np.linspace(0, 8 * np.pi, 400))
    pull = np.concatenate([there, there[::-1], np.zeros(400)])  # back to neutral: bent by friction alone
    lateral = np.concatenate([np.zeros(160), cycles])
    episode = twin.simulate(DRY, pull, T, lateral_pull=lateral)
    assert episode.bend[159] > np.radians(2)
    assert abs(episode.bend[-1]) < 0.05 * episode.bend[159]


def test_it_never_gives_energy(twin):
    """Work of both pulleys over closed circles is what friction takes, and friction takes some."""
    pull, lateral = around(2e-3, 0.0)
    episode = twin.simulate(DRY, pull, T, lateral_pull=lateral)
    turn = slice(-round(PERIOD / T) - 1, None)
    tension = episode.wire_tension[turn, :, 0]
    work = 0.0
    for plane, command in enumerate((pull[turn], lateral[turn])):
        net = tension[:, 2 * plane] - tension[:, 2 * plane + 1]
        work += float(((net[1:] + net[:-1]) / 2 * np.diff(command)).sum())
    # A direction that turns all round slides against both planes' friction by a circle's circumference.
    assert work > 0.5 * DRY.sheath_friction_floor * 2 * np.pi * 1.5e-3
