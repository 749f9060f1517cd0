"""The drive: the play operator against its definition, the servo against analytic motions and its limits."""

import itertools
import math
import struct

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from twin.mechanics.drive import PARTS, Drive
from twin.preset.preset import Preset

PERIOD = Preset("reference").control_period
ROUNDING = 1e-15  # m: what thousands of additions of some millimetres may lose
DISTANCES = st.floats(-5e-3, 5e-3)
PATHS = st.lists(DISTANCES, min_size=1, max_size=30)
PLAYS = st.floats(1e-6, 4e-3)
GAINS = st.floats(5.0, 900.0)
SPEEDS = st.floats(2e-3, 1.0)
ACCELERATIONS = st.floats(2e-2, 100.0)
COUNTS = st.integers(60, 2**20)


def or_none(values: st.SearchStrategy) -> st.SearchStrategy:
    return st.sampled_from([0]) | values


DRIVES = st.fixed_dictionaries(
    {
        "servo_gain": or_none(GAINS),
        "servo_speed": or_none(SPEEDS),
        "servo_acceleration": or_none(ACCELERATIONS),
        "encoder_counts": or_none(COUNTS),
    }
)


LIMITED = {"servo_speed": 0.02, "servo_acceleration": 2.0}


def drive(**parameters) -> Drive:
    return Drive(Preset("drive", **parameters))


def bits(values) -> bytes:
    values = list(values)
    return struct.pack(f"{len(values)}d", *values)


def play(path, width: float) -> list[float]:
    gear = drive(backlash=width)
    return [gear.advance(distance) for distance in path]


def motor_path(motor: Drive, commands) -> np.ndarray:
    """Motor positions: the first is where it starts."""
    positions = [motor.state()[0]]
    for command in commands:
        motor.advance(command)
        positions.append(motor.state()[0])
    return np.array(positions)


def settle(motor: Drive, command: float) -> list[float]:
    """Hold a command until nothing moves any more, and return the motor's way there."""
    positions = [motor.state()[0]]
    for _ in range(30_000):
        before = motor.state()
        motor.advance(command)
        positions.append(motor.state()[0])
        if motor.state() == before:
            return positions
    raise AssertionError(f"still moving: {before} -> {motor.state()}")


def overshoot(way, target: float) -> float:
    """How far a way goes beyond the target; negative where it ends short of it."""
    way = np.asarray(way)
    return float((math.copysign(1.0, target - way[0]) * (way - target)).max())


def count_of(parameters: dict) -> float:
    """Width of one count of the encoder [m]; 0 without one."""
    counts = parameters["encoder_counts"]
    return 2 * math.pi * Preset("reference").pulley_radius / counts if counts else 0.0


# The ideal drive.


@given(commands=st.lists(st.floats(allow_nan=False, allow_infinity=False)))
@example(commands=[1.0, -0.0, 0.0, -0.0, 5e-324, -1.0])
def test_without_servo_encoder_and_backlash_the_command_arrives_bit_for_bit(commands):
    ideal = drive()
    assert bits(ideal.advance(command) for command in commands) == bits(commands)


@pytest.mark.parametrize("command", [math.nan, math.inf, -math.inf])
def test_command_that_is_no_distance_is_refused_and_changes_nothing(command):
    for parameters in ({}, {"servo_gain": 50.0, "backlash": 1e-4}, {"encoder_counts": 1000}):
        refusing = drive(**parameters)
        refusing.advance(1e-3)
        before = refusing.state()
        with pytest.raises(ValueError, match=r"commanded pulling distance .* must be a finite number"):
            refusing.advance(command)
        assert refusing.state() == before


# The play of the gear.


@given(path=PATHS, width=PLAYS)
def test_pulley_obeys_the_variational_inequality_of_the_play(path, width):
    before = 0.0
    for motor, pulley in zip(path, play(path, width), strict=True):
        assert abs(motor - pulley) <= width / 2 * (1 + 1e-12) + 1e-18
        if pulley > before:  # pushed up: by the lower flank, and no further
            assert motor - pulley == pytest.approx(width / 2, abs=1e-17)
        elif pulley < before:
            assert pulley - motor == pytest.approx(width / 2, abs=1e-17)
        before = pulley


@given(
    path=PATHS,
    width=PLAYS,
    shares=st.lists(st.lists(st.floats(0.0, 1.0), max_size=4), min_size=30, max_size=30),
)
def test_pulley_does_not_depend_on_how_fast_or_finely_the_path_is_run(path, width, shares):
    dense, corners, before = [], [], 0.0
    for target, parts in zip(path, shares, strict=False):
        low, high = min(before, target), max(before, target)
        between = [min(max(before + share * (target - before), low), high) for share in sorted(parts)]
        dense += [*between, target]
        corners.append(len(dense) - 1)
        before = target
    assert bits(play(dense, width)[corner] for corner in corners) == bits(play(path, width))


@given(path=PATHS, width=PLAYS, ends=st.tuples(DISTANCES, DISTANCES, DISTANCES), future=PATHS)
def test_closed_inner_loop_leaves_no_memory(path, width, ends, future):
    low, inner, high = sorted(ends)
    for turn, back in ((low, high), (high, low)):  # Madelung's rules, on both branches
        with_loop = play([*path, turn, back, inner, back, *future], width)
        without = play([*path, turn, back, *future], width)
        assert bits(with_loop[len(path) + 3 :]) == bits(without[len(path) + 1 :])


@given(width=PLAYS, beyond=st.floats(1e-4, 5e-3))
def test_loop_has_the_area_of_the_parallelogram(width, beyond):
    amplitude = width / 2 + beyond
    corners = [amplitude, amplitude - width, -amplitude, -amplitude + width]
    motor = np.array([*corners, amplitude])
    pulley = np.array(play([amplitude, *corners[1:], amplitude], width))
    area = 0.5 * abs(np.sum(motor[:-1] * pulley[1:] - motor[1:] * pulley[:-1]))
    assert area == pytest.approx(2 * width * beyond, rel=1e-9)
    assert np.ptp(pulley) == pytest.approx(2 * beyond, rel=1e-9)


# The servo.


@given(gain=GAINS, step=DISTANCES, periods=st.integers(1, 200))
def test_position_loop_is_the_analytic_first_order_lag(gain, step, periods):
    motor = motor_path(drive(servo_gain=gain), [step] * periods)
    expected = step * -np.expm1(-gain * PERIOD * np.arange(periods + 1))
    np.testing.assert_allclose(motor, expected, rtol=1e-11, atol=1e-20)


@given(gain=GAINS, speed=st.floats(1e-3, 0.05))
def test_motor_lags_behind_a_steady_pull_by_speed_over_gain(gain, speed):
    commands = speed * PERIOD * np.arange(1, 2000)
    lag = commands - motor_path(drive(servo_gain=gain), commands.tolist())[1:]
    expected = speed * PERIOD / math.expm1(gain * PERIOD)
    assert lag[-1] == pytest.approx(expected, rel=1e-6, abs=1e-13)
    assert expected == pytest.approx(speed / gain, abs=speed * PERIOD / 2)


@given(parameters=DRIVES, path=PATHS, hold=st.integers(1, 5))
def test_speed_and_acceleration_stay_within_their_limits(parameters, path, hold):
    commands = [command for command in path for _ in range(hold)]
    stride = np.diff(motor_path(drive(**parameters), commands))
    change = np.diff(stride, prepend=0.0)
    if parameters["servo_speed"]:
        assert np.abs(stride).max() <= parameters["servo_speed"] * PERIOD + ROUNDING
    if parameters["servo_acceleration"]:
        assert (
            np.abs(change).max() <= (1 + 1 / PARTS) * parameters["servo_acceleration"] * PERIOD**2 + ROUNDING
        )


@given(acceleration=ACCELERATIONS, periods=st.integers(2, 100))
def test_acceleration_limit_alone_gives_the_triangle_of_speed(acceleration, periods):
    unit = acceleration * PERIOD**2
    way = periods**2 * unit  # half of it speeding up for so many control periods, half of it slowing down
    motor = motor_path(drive(servo_acceleration=acceleration), [way] * (2 * periods + 1)) / unit
    time = np.arange(2 * periods + 2)
    left = np.maximum(2 * periods - time, 0)
    triangle = np.where(time <= periods, time**2 / 2, periods**2 - left**2 / 2)
    np.testing.assert_allclose(motor, triangle, atol=1.01 * periods / PARTS)
    assert motor[-1] == pytest.approx(periods**2)


@given(parameters=DRIVES, first=DISTANCES, second=DISTANCES)
def test_motor_arrives_from_rest_without_overshoot_and_stays(parameters, first, second):
    motor = drive(**parameters)
    settle(motor, first)
    way = np.array(settle(motor, second))
    count = count_of(parameters)
    middle = count * round(second / count) if count else second
    assert (math.copysign(1.0, middle - way[0]) * np.diff(way) >= -ROUNDING).all()  # never back
    assert overshoot(way, middle) <= count / 4 + ROUNDING
    assert abs(way[-1] - middle) <= count / 2 + ROUNDING
    if not count and not parameters["servo_gain"]:
        assert way[-1] == second

    rest = motor.state()
    for _ in range(20):
        motor.advance(second)
    assert motor.state() == rest


@given(parameters=DRIVES, path=PATHS, command=DISTANCES)
def test_motor_comes_to_rest_from_any_motion(parameters, path, command):
    motor = drive(**parameters)
    motor_path(motor, path)
    assert abs(settle(motor, command)[-1] - command) <= count_of(parameters) + ROUNDING


# The encoder.


@given(
    steps=st.lists(st.integers(-4, 4), min_size=1, max_size=20),
    halves=st.integers(1, 9),
    acceleration=st.sampled_from([0, 0.1, 1.0, 10.0]),
)
def test_motor_that_stops_between_two_counts_does_not_hunt(steps, halves, acceleration):
    count = count_of({"encoder_counts": 4096})
    speed = halves * count / 2 / PERIOD  # strides of half counts end on the very edge between two
    motor = drive(servo_speed=speed, servo_acceleration=acceleration, encoder_counts=4096)
    for target in itertools.accumulate(steps):
        way = settle(motor, target * count)
        assert abs(way[-1] - target * count) <= count / 2 + ROUNDING
        assert overshoot(way, target * count) <= count / 4 + ROUNDING


@given(parameters=DRIVES, counts=COUNTS, numbers=st.lists(st.integers(-50, 50), min_size=1), data=st.data())
def test_servo_sees_no_difference_within_a_count(parameters, counts, numbers, data):
    parameters["encoder_counts"] = counts
    count = count_of(parameters)
    within = st.floats(-0.49, 0.49)
    rough, fine = drive(**parameters), drive(**parameters)
    for number in numbers:
        rough.advance(number * count)
        fine.advance((number + data.draw(within)) * count)
        assert bits(rough.state()[:3]) == bits(fine.state()[:3])


# The state.


@given(parameters=DRIVES, width=or_none(PLAYS), past=PATHS, future=PATHS)
def test_restored_drive_goes_on_bit_for_bit_and_a_reset_one_is_new(parameters, width, past, future):
    used = drive(backlash=width, **parameters)
    motor_path(used, past)
    restored = drive(backlash=width, **parameters)
    restored.restore(used.state())
    assert bits(map(restored.advance, future)) == bits(map(used.advance, future))
    assert bits(restored.state()) == bits(used.state())

    used.reset()
    new = drive(backlash=width, **parameters)
    assert bits(used.state()) == bits(new.state()) == bits([0.0, 0.0, 0.0, 0.0])
    assert bits(map(used.advance, future)) == bits(map(new.advance, future))


@given(parameters=DRIVES, width=or_none(PLAYS), past=PATHS, slow=st.booleans(), future=PATHS)
@example(parameters={}, width=0, past=[1e-3, 3e-3], slow=False, future=[2e-3])
@example(parameters=LIMITED, width=0, past=[1e-3, 3e-3], slow=False, future=[1e-3])
@example(parameters=LIMITED, width=0, past=[], slow=True, future=[1e-3, 3e-3])
def test_a_drive_follows_many_commands_as_one_after_the_other(parameters, width, past, slow, future):
    one, many = drive(backlash=width, **parameters), drive(backlash=width, **parameters)
    if slow:  # its limits do not hold it back
        future = [1e-6 * command for command in future]
    for commands in ([0.0], past, [*future, 0.0, 0.0], future) if not slow else ([0.0], future):
        assert bits([one.advance(command) for command in commands]) == bits(many.follow(np.array(commands)))
        assert bits(one.state()) == bits(many.state())
