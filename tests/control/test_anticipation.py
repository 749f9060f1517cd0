"""Going ahead of a known reference, on a play (backlash): its lag and its lead are known in closed form."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.control.anticipation import Anticipation
from twin.control.controller import CommandLimits

T = 0.02
LIMITS = CommandLimits(-10.0, 10.0, 5.0)
WAY = LIMITS.speed_mm_s * T
GAIN = 10.0  # deg/mm


class Play:
    """A dead band of a width [mm] in front of a gain: it knows the way that friction asks of a command."""

    def __init__(self, width_mm: float, output_mm: float = 0.0) -> None:
        self.width, self.output = width_mm, output_mm

    def step(self, pull_mm: float) -> float:
        self.output = min(max(self.output, pull_mm - self.width), pull_mm)
        return GAIN * self.output

    @property
    def bend_deg(self) -> float:
        return GAIN * self.output

    def along(self, pulls_mm, samples):
        copy = Play(self.width, self.output)
        return np.array([copy.step(pull) for pull in pulls_mm]) - self.bend_deg

    def inverse_mm(self, pull_mm: float, bend_deg: float) -> float:
        """The pull that brings a bend: on that side of the play which moves the output there."""
        wanted = bend_deg / GAIN
        if abs(bend_deg - self.bend_deg) < 1e-9:
            return pull_mm
        return wanted + self.width if wanted > self.output else wanted


def followed(reference, play, preview_s, limits=LIMITS):
    """Return errors [deg] and commands of who inverts the play exactly, ahead where that is due."""
    anticipation, ahead = Anticipation(limits, T), round(preview_s / T)
    pull, errors, pulls = play.output + play.width, [], []
    for k in range(len(reference) - 1):
        coming = reference[k + 1 : k + 1 + ahead]
        wanted = anticipation.wanted_mm(pull, play.bend_deg, float(reference[k]), coming, play.along)
        if math.isnan(wanted):
            wanted = play.inverse_mm(pull, float(reference[k + 1]))
        pull = limits.within(wanted, pull, T)
        errors.append(play.step(pull) - reference[k + 1])
        pulls.append(pull)
    return np.array(errors), np.array(pulls)


def sine(amplitude_deg, period_s, seconds=20.0):
    return amplitude_deg * np.sin(2 * np.pi * np.arange(0, seconds, T) / period_s)


@pytest.mark.parametrize("width_mm", [1.0, 2.0, 3.0, 4.0])
def test_at_a_peak_the_largest_error_is_near_that_of_the_best_moment_to_turn(width_mm):
    """The bend stands for t = width / speed. Who turns at the peak is off by A (1 - cos w t) in the end; who
    leaves s earlier is off by A (1 - cos w s) at the peak and by A (cos w s - cos w (t - s)) in the end."""
    amplitude, omega = 10.0, 2 * np.pi / 8.0
    stands = width_mm / LIMITS.speed_mm_s
    late, early = (
        np.abs(followed(sine(amplitude, 8.0), Play(width_mm), preview)[0][300:]) for preview in (0.0, 1.0)
    )
    assert late.max() == pytest.approx(amplitude * (1 - np.cos(omega * stands)), abs=0.2)
    leave = np.linspace(0.0, stands, 10_001)
    before = amplitude * (1 - np.cos(omega * leave))
    behind = amplitude * (np.cos(omega * leave) - np.cos(omega * (stands - leave)))
    best = np.maximum(before, np.abs(behind)).min()
    if width_mm < 3.0:  # what would be late by less than LATE_DEG for most of the way is left as it is
        np.testing.assert_array_equal(early, late)
    else:
        assert best - 0.1 < early.max() < best + 0.5 * (late.max() - best)
        assert np.sqrt(np.mean(early**2)) < 0.5 * np.sqrt(np.mean(late**2))


@given(
    level=st.floats(-30, 30),
    bend=st.floats(-30, 30),
    coming=st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=60),
    width=st.floats(0.01, 5),
)
def test_whatever_comes_it_asks_for_no_more_than_one_sample_of_its_speed(level, bend, coming, width):
    anticipation, play = Anticipation(LIMITS, T), Play(width, bend / GAIN)
    for _ in range(5):
        wanted = anticipation.wanted_mm(level / 10, bend, level, np.array(coming), play.along)
        assert math.isnan(wanted) or abs(wanted - level / 10) <= WAY * (1 + 1e-9)
        assert not (math.isnan(wanted) and anticipation.direction)
