"""Work, friction's loss and stored energy of the endoscope against the laws of thermodynamics and statics."""

import numpy as np
import pytest
from driven_endoscope import AMPLITUDE, PRESET, SAMPLE_TIME, loop_of, ramp_and_rest
from scipy.optimize import minimize_scalar

from twin.preset.preset import Preset


def test_closed_cycles_never_give_energy(twin):
    """Second law: whatever periodic command has settled, the drive puts work in and gets none out."""
    count, rng = 20, np.random.default_rng(0)
    phase = np.linspace(0, 2 * np.pi, 301)
    harmonics = np.arange(1, 5)[:, None, None]
    amplitudes, phases = rng.normal(size=(4, count, 1)) / harmonics, rng.uniform(0, 2 * np.pi, (4, count, 1))
    waves = (amplitudes * np.sin(harmonics * phase + phases)).sum(axis=0)
    waves *= rng.uniform(0.5e-3, AMPLITUDE, (count, 1)) / np.abs(waves).max(axis=1, keepdims=True)
    twice = np.concatenate([waves, waves[:, 1:]], axis=1)
    episodes = twin.simulate_batch([PRESET] * count, list(twice), SAMPLE_TIME)
    for episode in episodes:
        force = (episode.tension[:, 0] - episode.tension[:, 1])[300:]
        pulley = episode.pulley[300:]
        assert np.trapezoid(force, pulley) > -1e-6 * np.ptp(force) * np.ptp(pulley)


def test_work_of_the_pulley_is_what_friction_dissipates(twin):
    """First law over a closed cycle: the springs give back what they took, so the rest went into friction."""
    # Enough in the hinges that both losses count; that of wires on vertebrae is not counted.
    preset = PRESET.without_viscosity().replace(joint_friction=2e-3, routing_friction=0.0)
    sliding, turning, friction, tension, pulley = [], [], [], [], []

    def note(endoscope) -> None:
        sliding.append(twin.sliding(endoscope))
        turning.append(endoscope.joint_angle())
        friction.append(endoscope.sheath_friction().ravel())
        tension.append(endoscope.wire_tension()[:, 0])
        pulley.append(endoscope.pull())

    loop_of(twin, preset, 8.0, on_sample=note)
    cycle = slice(round(8.0 / SAMPLE_TIME), None)
    force = -np.diff(np.array(tension)[cycle], axis=1)[:, 0]  # of wire a less that of wire b
    work = np.trapezoid(force, np.array(pulley)[cycle])
    loss_in_sheath = np.sum(np.array(friction)[cycle][1:] * np.abs(np.diff(np.array(sliding)[cycle], axis=0)))
    loss_in_hinges = preset.joint_friction * np.sum(np.abs(np.diff(np.array(turning)[cycle], axis=0)))
    assert work == pytest.approx(loss_in_sheath + loss_in_hinges, rel=0.005)
    assert min(loss_in_sheath, loss_in_hinges) > 0.05 * work


def bend_of_least_energy(preset: Preset, pull: float) -> float:
    """Friction-free statics: an elastic section between two one-sided, stiffening springs that wind on it."""
    lengths = preset.sheath_elements + 1
    stiffness = preset.wire_stiffness * lengths
    quadratic = preset.wire_stiffening * stiffness**2 / 2
    at_rest = max(np.roots([quadratic, stiffness, -preset.pretension]))

    def energy(bend: float) -> float:
        stored = preset.section_stiffness * (bend**2 / 2 + preset.section_stiffening * bend**4 / 4)
        for side in (1, -1):
            stretch = max(side * (pull - preset.wire_offset * bend) / lengths + at_rest, 0.0)
            stored += lengths * (stiffness * stretch**2 / 2 + quadratic * stretch**3 / 3)
        return stored

    return minimize_scalar(energy, bounds=(0, 3), method="bounded", options={"xatol": 1e-10}).x


@pytest.mark.parametrize("pull", [0.3e-3, 2e-3, 4e-3])  # with wire b taut, and slack
@pytest.mark.parametrize("vertebrae", [8, 16, 32])
def test_friction_free_bend_is_the_one_of_least_energy(twin, pull, vertebrae):
    preset = PRESET.without_friction().replace(vertebrae=vertebrae)
    episode = twin.simulate(preset, ramp_and_rest(pull), SAMPLE_TIME)
    assert episode.bend[-1] == pytest.approx(bend_of_least_energy(preset, episode.pulley[-1]), rel=1e-3)
