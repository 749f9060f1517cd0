"""Many endoscopes at once against one after the other: the same records, bit for bit."""

import dataclasses

import numpy as np
import pytest
from both_twins import Twin
from plain_endoscope import PLAIN

from twin.episode import Episode
from twin.preset.preset import Preset

SAMPLE_TIME = 0.02  # [s]
SOFT = PLAIN.replace(
    name="soft",
    section_length=0.05,
    section_mass=1e-3,
    section_stiffness=0.02,
    section_damping=1e-5,
    wire_offset=2e-3,
    wire_stiffness=4e3,
    wire_damping=1.0,
    pretension=5.0,
    sheath_friction=0.15,
    sheath_bend=1.0,
    sheath_friction_floor=1.5,
    joint_friction=2e-4,
)
CURVED = PLAIN.replace(
    name="curved",
    section_stiffening=0.5,
    initial_bend=0.3,
    joint_friction_taper=0.4,
    routing_friction=0.1,
    wire_stiffening=0.05,
    sheath_bend_offset=0.4,
    gravity_x=1.0,
    gravity_y=2.0,
    gravity_z=-9.81,
)
DRIFTING = SOFT.replace(name="drifting", friction_warm_up=0.5, warm_up_time=1.0, friction_wear=20.0)
DRIVEN = CURVED.replace(
    name="driven",
    backlash=2e-4,
    servo_gain=50.0,
    servo_speed=0.05,
    servo_acceleration=2.0,
    encoder_counts=4000,
    friction_wear=5.0,
)
SMOOTH = PLAIN.without_friction().replace(name="smooth")
PRESETS = [PLAIN, SOFT, CURVED, DRIFTING, DRIVEN, SMOOTH]
SAMPLES = [20, 31, 12, 31, 25, 2]


def swing(index: int, amplitude: float) -> np.ndarray:
    """A command of its own for each endoscope: another length, start and rate."""
    time = np.arange(SAMPLES[index]) * SAMPLE_TIME
    return amplitude * np.sin((3 + index) * time + 0.3 * (index % 3))


PULLS = [swing(index, 2e-3) for index in range(len(PRESETS))]
SHEATH_BENDS = [None, 0.5, np.linspace(0, 3, SAMPLES[2]), np.linspace(3, 0, SAMPLES[3]), None, 1.0]


def assert_same(record: Episode | None, expected: Episode) -> None:
    """Every array, every parameter and the model."""
    assert record is not None
    for field in dataclasses.fields(Episode):
        of_record, wanted = getattr(record, field.name), getattr(expected, field.name)
        if isinstance(wanted, np.ndarray):
            assert np.array_equal(of_record, wanted), field.name
        else:
            assert of_record == wanted, field.name


@pytest.mark.parametrize("planes", [1, 2])
def test_batch_is_what_one_after_the_other_gives_whatever_the_number_of_threads(twin, planes):
    presets = [twin.able(preset).replace(bending_planes=planes) for preset in PRESETS]
    laterals = [None] * len(presets)
    if planes == 2:
        laterals = [None, *(swing(index, -1e-3) for index in range(1, len(presets)))]
    serial = [
        twin.simulate(preset, pull, SAMPLE_TIME, lateral_pull=lateral, sheath_bend=bend)
        for preset, pull, lateral, bend in zip(presets, PULLS, laterals, SHEATH_BENDS, strict=True)
    ]
    for threads in (1, 2):
        together = twin.simulate_batch(
            presets, PULLS, SAMPLE_TIME, sheath_bends=SHEATH_BENDS, lateral_pulls=laterals, threads=threads
        )
        for record, expected in zip(together, serial, strict=True):
            assert_same(record, expected)
    assert all(expected.wire_slack.shape == expected.wire_tension.shape for expected in serial)
    assert max(expected.wire_slack.max() for expected in serial) > 0.1e-3  # equal, and not all zero
    bends = [np.ptp(expected.bend) for expected in serial[:-1]]
    assert min(bends) > 0.02
    assert len({float(bend) for bend in bends}) == len(bends)


FLYING = np.concatenate([np.zeros(10), np.full(10, 1e11)])  # further than MuJoCo takes any number
FALLING = PLAIN.replace(section_mass=10.0, gravity_z=100.0, section_stiffness=1e-6, wire_stiffness=10.0)


def alone(twin: Twin, preset: Preset, pull: np.ndarray) -> Episode | None:
    try:
        return twin.simulate(preset, pull, SAMPLE_TIME)
    except FloatingPointError:
        return None


@pytest.mark.parametrize(("preset", "pull"), [(PLAIN, FLYING), (FALLING, PULLS[0])], ids=["pull", "preset"])
def test_endoscope_that_diverges_has_no_record_and_leaves_the_others_alone(twin, preset, pull):
    preset, curved = twin.able(preset), twin.able(CURVED)
    first, diverged, last = twin.simulate_batch(
        [SOFT, preset, curved], [PULLS[1], pull, PULLS[2]], SAMPLE_TIME
    )
    assert (diverged is None) == (alone(twin, preset, pull) is None)
    assert_same(first, twin.simulate(SOFT, PULLS[1], SAMPLE_TIME))
    assert_same(last, twin.simulate(curved, PULLS[2], SAMPLE_TIME))


@pytest.mark.parametrize("other", [{"bending_planes": 2}, {"vertebrae": 6}])
def test_endoscopes_of_different_layout_are_refused_by_name(twin, other):
    presets = [PLAIN, SOFT, PLAIN.replace(**other)]
    with pytest.raises(ValueError, match=f"batch must agree in {next(iter(other))}") as refused:
        twin.simulate_batch(presets, [PULLS[0]] * 3, SAMPLE_TIME)
    assert "\n" not in str(refused.value)


def test_commands_that_cannot_be_are_refused_before_any_work(twin):
    with pytest.raises(ValueError, match="at least one endoscope"):
        twin.simulate_batch([], [], SAMPLE_TIME)
    with pytest.raises(ValueError, match="bend of the sheath has 3 samples, the command has 31"):
        twin.simulate_batch([PLAIN, SOFT], PULLS[:2], SAMPLE_TIME, sheath_bends=[None, np.ones(3)])
    with pytest.raises(ValueError, match="the sheath's bend is -1 rad"):
        twin.simulate_batch([PLAIN, SOFT], PULLS[:2], SAMPLE_TIME, sheath_bends=[None, -1.0])
    with pytest.raises(ValueError, match="'soft' has one bending plane"):
        twin.simulate_batch([PLAIN, SOFT], PULLS[:2], SAMPLE_TIME, lateral_pulls=[None, PULLS[1]])
