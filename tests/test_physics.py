"""The physics against theory: dry friction, one-sided wires, statics, energy, and the saved state."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from twin.episode import Episode
from twin.excitation import approach
from twin.physics import Endoscope, simulate, simulate_batch
from twin.preset import Preset, load_preset

AMPLITUDE = 4e-3  # [m]
SAMPLE_TIME = 0.02  # [s]
PRESET = load_preset("ureteroscope")


def sine(period: float, cycles: float) -> np.ndarray:
    phase = np.arange(round(cycles * period / SAMPLE_TIME) + 1) * SAMPLE_TIME / period
    return AMPLITUDE * np.sin(2 * np.pi * phase)


def ramp_and_rest(pull: float, seconds: float = 3.0) -> np.ndarray:
    """From rest to `pull` at a steady speed, then a second of rest."""
    return np.concatenate([np.linspace(0, pull, round(seconds / SAMPLE_TIME)), np.full(50, pull)])


def loop_of(preset: Preset, period: float, on_sample=None) -> tuple[np.ndarray, np.ndarray]:
    """Pull [mm] and bend [deg] of the second of two cycles; it starts and ends at mid-stroke, rising."""
    episode = simulate(preset, sine(period, 2), SAMPLE_TIME, on_sample=on_sample)
    start = round(period / SAMPLE_TIME)
    return episode.pull_mm[start:], episode.bend_deg[start:]


def width_of(pull: np.ndarray, bend: np.ndarray) -> np.ndarray:
    """Falling minus rising branch on a common grid of pulls [deg]."""
    top, bottom = pull.argmax(), pull.argmin()
    grid = np.linspace(pull.min(), pull.max(), 801)
    falling = np.interp(grid, pull[top : bottom + 1][::-1], bend[top : bottom + 1][::-1])
    rising_pull = np.concatenate([pull[bottom:], pull[1 : top + 1]])  # the cycle closes
    rising = np.interp(grid, rising_pull, np.concatenate([bend[bottom:], bend[1 : top + 1]]))
    return falling - rising


@pytest.fixture(scope="module")
def loop() -> tuple[np.ndarray, np.ndarray]:
    return loop_of(PRESET, 8.0)


@pytest.fixture(scope="module")
def loop_episode() -> Episode:
    return simulate(PRESET, sine(8.0, 2), SAMPLE_TIME)


@pytest.mark.parametrize("viscous", [True, False])
def test_loop_area_does_not_depend_on_rate(viscous):
    preset = PRESET if viscous else PRESET.without_viscosity()
    areas = []
    for period in (2.0, 8.0, 32.0):
        pull, bend = loop_of(preset, period)
        areas.append(abs(np.trapezoid(bend, pull)))
    assert np.ptp(areas) / np.mean(areas) < 0.02


def test_time_step_is_short_enough(loop):
    _, fine = loop_of(PRESET.replace(time_step=PRESET.time_step / 8), 8.0)
    assert np.abs(loop[1] - fine).max() < 0.01 * np.ptp(fine)


def test_time_step_is_short_enough_for_soft_wires_too():
    """The manipulator's light links need many iterations against creep at a much smaller step."""
    preset = load_preset("vio_com")
    command = 2.5 * sine(8.0, 1)
    coarse, fine = (
        simulate(p, command, SAMPLE_TIME).bend
        for p in (preset, preset.replace(time_step=preset.time_step / 8))
    )
    assert np.abs(coarse - fine).max() < 0.01 * np.ptp(fine)


def test_friction_makes_memory(loop):
    pull, bend = loop
    assert np.abs(width_of(pull, bend)[400]) > 0.03 * np.ptp(bend)  # at mid-stroke, one pull and two angles


@pytest.mark.parametrize("viscous", [True, False])
def test_without_friction_there_is_no_loop(viscous):
    preset = PRESET.without_friction() if viscous else PRESET.without_friction().without_viscosity()
    pull, bend = loop_of(preset, 8.0)
    assert np.abs(width_of(pull, bend)).max() < 0.005 * np.ptp(bend)


@pytest.mark.parametrize(
    "cycles",
    [1.25, 1.0, 1.5, 1.12, 1.35, 1.75],
    ids=["top", "mid rising", "mid falling", "high rising", "high falling", "bottom"],
)
def test_held_command_does_not_drift(loop, cycles):
    moving = sine(8.0, cycles)
    held = np.full(round(30 / SAMPLE_TIME), moving[-1])
    episode = simulate(PRESET, np.concatenate([moving, held]), SAMPLE_TIME)
    after = episode.bend_deg[len(moving) - 1 :]  # settling after the sudden stop included
    assert np.abs(after - after[0]).max() < 0.005 * np.ptp(loop[1])
    assert np.abs(after[50:] - after[50]).max() < 1e-5 * np.ptp(loop[1])  # static friction does not creep


@pytest.mark.parametrize(("low", "high"), [(-1e-3, 2e-3), (0.5e-3, 3.5e-3), (-3e-3, -2e-3)])
def test_minor_loop_closes_and_is_wiped_out(loop, low, high):
    """Madelung's rules: back where it began, a minor loop leaves no trace in what follows."""
    before = np.concatenate([sine(8.0, 1.25), np.linspace(AMPLITUDE, low, 300)[1:]])
    minor = np.concatenate([np.linspace(low, high, 200)[1:], np.linspace(high, low, 200)[1:]])
    after = np.linspace(low, -AMPLITUDE, 200)[1:]
    with_loop, without = simulate_batch(
        [PRESET] * 2,
        [np.concatenate([before, minor, after]), np.concatenate([before, after])],
        SAMPLE_TIME,
    )
    begun, closed = len(before) - 1, len(before) + len(minor) - 1
    bends = with_loop.bend_deg
    assert np.abs(bends[begun : closed + 1] - bends[begun]).max() > 0.01 * np.ptp(loop[1])  # it is a loop
    off = bends[closed:] - without.bend_deg[begun:]
    assert np.abs(off).max() < 0.005 * np.ptp(loop[1])


def test_closed_cycles_never_give_energy():
    """Second law: whatever periodic command has settled, the drive puts work in and gets none out."""
    count, rng = 60, np.random.default_rng(0)
    phase = np.linspace(0, 2 * np.pi, 301)
    harmonics = np.arange(1, 5)[:, None, None]
    amplitudes, phases = rng.normal(size=(4, count, 1)) / harmonics, rng.uniform(0, 2 * np.pi, (4, count, 1))
    waves = (amplitudes * np.sin(harmonics * phase + phases)).sum(axis=0)
    waves *= rng.uniform(0.5e-3, AMPLITUDE, (count, 1)) / np.abs(waves).max(axis=1, keepdims=True)
    twice = np.concatenate([waves, waves[:, 1:]], axis=1)
    episodes = simulate_batch([PRESET] * count, list(twice), SAMPLE_TIME)
    for episode in episodes:
        force = (episode.tension[:, 0] - episode.tension[:, 1])[300:]
        pulley = episode.pulley[300:]
        assert np.trapezoid(force, pulley) > -1e-6 * np.ptp(force) * np.ptp(pulley)


def test_work_of_the_pulley_is_what_friction_dissipates():
    """First law over a closed cycle: the springs give back what they took, so the rest went into friction."""
    preset = PRESET.without_viscosity().replace(joint_friction=2e-3)  # enough that both losses count
    sliding, turning, friction, tension, pulley = [], [], [], [], []

    def note(endoscope: Endoscope) -> None:
        position = endoscope.named.data.qpos
        elements = range(preset.sheath_elements)
        sliding.append([[position[f"sheath_{wire}{i}"][0] for i in elements] for wire in "ab"])
        turning.append(endoscope.joint_angle())
        friction.append(endoscope.sheath_friction().copy())
        tension.append(endoscope.wire_tension()[:, 0])
        pulley.append(endoscope.pull())

    loop_of(preset, 8.0, on_sample=note)
    cycle = slice(round(8.0 / SAMPLE_TIME), None)
    force = -np.diff(np.array(tension)[cycle], axis=1)[:, 0]  # of wire a less that of wire b
    work = np.trapezoid(force, np.array(pulley)[cycle])
    loss_in_sheath = np.sum(np.array(friction)[cycle][1:] * np.abs(np.diff(np.array(sliding)[cycle], axis=0)))
    loss_in_hinges = preset.joint_friction * np.sum(np.abs(np.diff(np.array(turning)[cycle], axis=0)))
    assert work == pytest.approx(loss_in_sheath + loss_in_hinges, rel=0.005)
    assert min(loss_in_sheath, loss_in_hinges) > 0.05 * work


def test_tension_is_the_force_that_acts_and_never_pushes():
    """The springs act on a sheath element with the tension of the length before it less that behind it."""
    acting, read = [], []

    def note(endoscope: Endoscope) -> None:
        endoscope.forward()  # the forces of a step are those at its beginning
        force = endoscope.named.data.qfrc_spring
        elements = range(PRESET.sheath_elements)
        acting.append([[force[f"sheath_{wire}{i}"][0] for i in elements] for wire in "ab"])
        read.append(endoscope.wire_tension())

    loop_of(PRESET, 8.0, on_sample=note)
    tension = np.array(read)
    np.testing.assert_allclose(acting, -np.diff(tension, axis=-1), atol=1e-4)  # the MJCF text has 6 digits
    assert (tension >= 0).all()
    assert (tension[:, :, [0, -1]] == 0).any(axis=0).all()  # slack at times, at the pulley and at the tip


def test_paid_out_wire_goes_slack_at_a_large_pull():
    episode = simulate(PRESET, ramp_and_rest(8e-3), SAMPLE_TIME)
    assert episode.tension[0] == pytest.approx(PRESET.pretension, rel=1e-4)
    assert episode.tension[-1, 0] > 4 * PRESET.pretension
    assert episode.tension[-1, 1] == 0.0  # paid out faster than the bending takes it up


def test_wire_is_slack_exactly_where_it_carries_nothing(loop_episode):
    tension, slack = loop_episode.wire_tension, loop_episode.wire_slack
    assert slack.shape == tension.shape
    assert (slack >= 0).all()
    taut = tension > 0
    assert (slack[taut] == 0).all()
    assert (slack[~taut] > 0).all()
    assert 0.01 < np.mean(~taut) < 0.99
    assert slack.max() > 0.1e-3


def test_slack_is_what_the_way_of_the_wire_leaves_over(loop_episode):
    """No wire is lost: stretch (less slack) grows by what the pulley takes up less what the tip gives."""
    stiffness = PRESET.wire_stiffness * (PRESET.sheath_elements + 1)  # of one of the lengths in series
    half = PRESET.wire_stiffening * stiffness / 2
    stretched = (np.sqrt(1 + 4 * half * loop_episode.wire_tension / stiffness) - 1) / (2 * half)
    stretch = (stretched - loop_episode.wire_slack).sum(axis=2)  # (samples, wires)
    taken_up = loop_episode.pulley - PRESET.wire_offset * loop_episode.bend
    for wire, side in enumerate((1.0, -1.0)):
        grown = side * (taken_up - taken_up[0])
        np.testing.assert_allclose(stretch[:, wire] - stretch[0, wire], grown, atol=1e-12)


def test_opposite_pulls_bend_to_opposite_sides_and_bend_rises_with_pull():
    up = simulate(PRESET, ramp_and_rest(AMPLITUDE), SAMPLE_TIME)
    down = simulate(PRESET, ramp_and_rest(-AMPLITUDE), SAMPLE_TIME)
    np.testing.assert_allclose(down.bend, -up.bend, atol=1e-6)
    np.testing.assert_allclose(down.wire_tension, up.wire_tension[:, ::-1], atol=1e-4)
    moving = up.bend[: len(up.bend) - 50]
    assert (np.diff(moving) >= -1e-9).all()
    assert moving[-1] > 1.0


def bend_of_least_energy(preset: Preset, pull: float) -> float:
    """Friction-free statics: an elastic section between two one-sided, stiffening springs that wind on it."""
    lengths = preset.sheath_elements + 1
    stiffness = preset.wire_stiffness * lengths
    quadratic = preset.wire_stiffening * stiffness**2 / 2
    at_rest = max(np.roots([quadratic, stiffness, -preset.pretension]))

    def energy(bend: float) -> float:
        stored = preset.section_stiffness * bend**2 / 2
        for side in (1, -1):
            stretch = max(side * (pull - preset.wire_offset * bend) / lengths + at_rest, 0.0)
            stored += lengths * (stiffness * stretch**2 / 2 + quadratic * stretch**3 / 3)
        return stored

    return minimize_scalar(energy, bounds=(0, 3), method="bounded", options={"xatol": 1e-10}).x


@pytest.mark.parametrize("pull", [0.3e-3, 2e-3, 4e-3])  # with wire b taut, and slack
@pytest.mark.parametrize("vertebrae", [8, 16, 32])
def test_friction_free_bend_is_the_one_of_least_energy(pull, vertebrae):
    preset = PRESET.without_friction().replace(vertebrae=vertebrae)
    endoscope = Endoscope.from_preset(preset)
    episode = simulate(preset, ramp_and_rest(pull), SAMPLE_TIME, endoscope=endoscope)
    assert episode.bend[-1] == pytest.approx(bend_of_least_energy(preset, endoscope.pull()), rel=1e-3)


@pytest.mark.parametrize("vertebrae", [8, 32, 64])
def test_loop_does_not_depend_on_the_number_of_vertebrae(loop, vertebrae):
    _, bend = loop_of(PRESET.replace(vertebrae=vertebrae), 8.0)
    assert np.abs(bend - loop[1]).max() < 0.02 * np.ptp(loop[1])


@pytest.fixture(scope="module")
def whole_run():
    command = sine(8.0, 2)
    endoscope = Endoscope.from_preset(PRESET)
    return command, simulate(PRESET, command, SAMPLE_TIME, endoscope=endoscope), endoscope


@pytest.mark.parametrize("sample", [37, 330, 500])
def test_state_restored_into_a_fresh_endoscope_continues_bit_for_bit(whole_run, sample):
    command, whole, at_end = whole_run
    first = Endoscope.from_preset(PRESET)
    simulate(PRESET, command[: sample + 1], SAMPLE_TIME, endoscope=first)
    fresh = Endoscope.from_preset(PRESET)
    rest = simulate(PRESET, command[sample:], SAMPLE_TIME, state=first.save_state(), endoscope=fresh)
    for field in ("bend", "joint_angle", "wire_tension", "wire_slack", "sheath_friction"):
        assert np.array_equal(getattr(rest, field), getattr(whole, field)[sample:]), field
    assert np.array_equal(fresh.data.ptr.qpos, at_end.data.ptr.qpos)
    assert np.array_equal(fresh.data.ptr.qvel, at_end.data.ptr.qvel)


@pytest.mark.parametrize("other", [{"vertebrae": 8}, {"sheath_elements": 3}])
def test_state_of_another_endoscope_is_refused(other):
    state = Endoscope.from_preset(PRESET.replace(**other)).save_state()
    with pytest.raises(ValueError, match="does not fit"):
        Endoscope.from_preset(PRESET).restore_state(state)


def test_two_runs_are_identical(whole_run):
    command, whole, _ = whole_run
    again = simulate(PRESET, command, SAMPLE_TIME)
    assert np.array_equal(again.bend, whole.bend)
    assert np.array_equal(again.wire_tension, whole.wire_tension)


def test_record_inside_the_stroke_starts_at_the_end_of_a_real_path():
    by_hand = Endoscope.from_preset(PRESET)
    for target in approach(3e-3, PRESET.control_period):
        by_hand.advance(target)
    record = simulate(PRESET, 3e-3 + 1e-3 * np.sin(np.arange(10) * 0.05), SAMPLE_TIME)
    assert record.bend[0] == by_hand.bend()
    assert np.array_equal(record.wire_tension[0], by_hand.wire_tension())


def test_unusable_commands_are_refused_in_one_line():
    with pytest.raises(ValueError, match="nan at sample 2") as refused:
        simulate(PRESET, np.array([0, 1e-3, np.nan]), SAMPLE_TIME)
    assert "\n" not in str(refused.value)
    for sample_time in (0.015, 0.005):
        with pytest.raises(ValueError, match="whole multiple of the control period"):
            simulate(PRESET, np.zeros(3), sample_time)
    with pytest.raises(ValueError, match="finite"):
        Endoscope.from_preset(PRESET).advance(np.inf)
