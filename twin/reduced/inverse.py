"""Inverse of reduced twins: the pull that brings a given bend at the end of the next sample.

Each endoscope has a pull of its own, or all have one in common, that brings a weighted sum of their bends.

From a given state the bend never falls as the pull rises, so that a bracket of two pulls holds the answer. It
is grown from where the command stands, and narrowed by Chandrupatla's method (1997, Advances in Engineering
Software 28: inverse quadratic interpolation where that is safe, else bisection). Every trial advances a copy
of the state by a whole sample, drive included, so that servo, encoder and backlash limit what is reached.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.mechanics.drive import DriveLaw
from twin.mechanics.kernels import copy_row, copy_rows, entry, kernel
from twin.reduced.advance import Workspace, advance_one
from twin.reduced.one_plane import Array, bend_of
from twin.reduced.parameters import ARM, COMMAND, DRIVE, Parameters, ReducedState

LEAST_WIDTH_M = 1e-9  # bracket that is not narrowed further [m]; nor is one of half a count of the encoder
ENCODER_STEP = DRIVE + DriveLaw._fields.index("encoder_step")
TRIALS = 60
Ends = tuple[float, float, float, float]
TURNS = 4  # times that the pulls of two planes are sought in turn: routing friction couples them weakly


class Inverse(NamedTuple):
    """Pulls of M endoscopes that bring given bends; P planes."""

    pull: Array  # (M, P) of wires a and c [m]
    bend: Array  # (M, P) that is reached with it [rad]
    bracket: Array  # (M, P, 2) lowest and highest pull between which it was found [m]
    reached: NDArray[np.bool_]  # (M,) whether the bend is within the tolerance; else it is the nearest


class Trial(NamedTuple):
    """Arguments of a trial of one endoscope, or of several that have one pull."""

    parameters: Parameters  # of M endoscopes
    state: ReducedState  # theirs; not changed
    scratch: ReducedState  # a state of the same shape; rewritten
    work: Workspace
    inputs: Array  # (M, 3) pull [m], lateral pull [m], bend of the sheath [rad] at the end of the sample
    periods: int  # control periods in the sample
    first: int  # of the endoscopes
    weights: Array  # of the bend of each, from the first on; (1,) of one by itself


@entry
def find_pulls(of: Trial, target: Array, limits: Array, tolerance: float, found: Inverse) -> None:
    """Find the pulls that bring given bends at the end of the next sample, of each endoscope by itself.

    The bends `target` (M, P) are NaN where the pull is to stay as it is, to a `tolerance` [rad]; `limits`
    (P, 2) are the lowest and highest pull of each plane [m].
    """
    planes, inputs = target.shape[1], of.inputs
    for m in range(len(inputs)):
        trial = Trial(of.parameters, of.state, of.scratch, of.work, inputs, of.periods, m, of.weights)
        for _ in range(TURNS):
            for p in range(planes):
                found.bracket[m, p] = inputs[m, p]
                if math.isnan(target[m, p]):
                    found.bend[m, p] = _bend_after(trial, p)
                else:
                    bracket = found.bracket[m, p]
                    found.bend[m, p] = _find(trial, p, target[m, p], limits[p], tolerance, bracket)
            found.reached[m] = True
            for p in range(planes):
                found.pull[m, p] = inputs[m, p]
                if planes > 1:  # the pull of one may have moved the other
                    found.bend[m, p] = _bend_after(trial, p)
                if abs(found.bend[m, p] - target[m, p]) > tolerance:
                    found.reached[m] = False
            if found.reached[m] or planes == 1:
                break


@kernel
def _bend_after(trial: Trial, p: int) -> float:
    """Return the weighted bend of a plane after one sample from a state, which stays as it is [rad]."""
    state, scratch, bend = trial.state, trial.scratch, 0.0
    for place in range(len(trial.weights)):
        m = trial.first + place
        copy_rows(scratch.element[m], state.element[m])
        copy_rows(scratch.hinge[m], state.hinge[m])
        copy_rows(scratch.slip[m], state.slip[m])
        copy_rows(scratch.turn[m], state.turn[m])
        copy_row(scratch.pulley[m], state.pulley[m])
        copy_rows(scratch.drive[m], state.drive[m])
        copy_rows(scratch.past[m], state.past[m])
        copy_row(scratch.run[m], state.run[m])
        advance_one(trial.parameters, scratch, trial.work, m, trial.inputs[m], trial.periods)
        bend += trial.weights[place] * bend_of(trial.parameters.size, scratch.hinge[m, p])
    return bend


@kernel
def _bend_at(trial: Trial, p: int, pull: float) -> float:
    """Return `_bend_after` with a pull, which is written into the inputs."""
    for place in range(len(trial.weights)):
        trial.inputs[trial.first + place, p] = pull
    return _bend_after(trial, p)


@kernel
def _find(trial: Trial, p: int, target: float, limits: Array, tolerance: float, bracket: Array) -> float:
    """Write the pull of one plane into the inputs, and its bracket; return the bend that it brings [rad]."""
    start = min(max(trial.state.run[trial.first, COMMAND + p], limits[0]), limits[1])
    near = far = start
    of_near = of_far = _bend_at(trial, p, start) - target
    bracket[:] = start
    if abs(of_near) <= tolerance:  # where it stands it may stay
        return target + of_near
    end = limits[1] if of_near < 0.0 else limits[0]
    # A wire that does not stretch would bend by the pull over the moment arm: no step can be shorter.
    step = -of_near * trial.parameters.constants[trial.first, ARM]
    while far != end and of_far * of_near > 0.0:
        near, of_near = far, of_far
        far = min(far + step, end) if step > 0.0 else max(far + step, end)
        step *= 2.0
        of_far = _bend_at(trial, p, far) - target
    if of_far * of_near > 0.0:
        # Out of reach: the shortest pull for nearly what the end of the stroke brings. A servo at its limit
        # of speed goes no further for a larger command.
        near = start
        of_near = _bend_at(trial, p, start) - target
        if abs(of_far - of_near) <= tolerance:
            return target + of_near
        nearly = of_far + math.copysign(tolerance / 2.0, of_far)
        of_near, of_far, target = of_near - nearly, of_far - nearly, target + nearly
        tolerance = tolerance / 4.0
    return target + _narrow(trial, p, target, tolerance, (near, of_near, far, of_far), bracket)


@kernel
def _narrow(trial: Trial, p: int, target: float, tolerance: float, ends: Ends, bracket: Array) -> float:
    """Narrow a bracket, pull and error at either end, by Chandrupatla's method; return the error left."""
    share, (x1, f1, x2, f2) = 0.5, ends
    least_width = max(LEAST_WIDTH_M, trial.parameters.constants[trial.first, ENCODER_STEP] / 2.0)
    if f1 != f2:
        share = min(max(f1 / (f1 - f2), 0.05), 0.95)
    for _ in range(TRIALS):
        x = x1 + share * (x2 - x1)
        f = _bend_at(trial, p, x) - target
        if f * f1 > 0.0:
            x3, f3, x1, f1 = x1, f1, x, f
        else:
            x3, f3, x2, f2, x1, f1 = x2, f2, x1, f1, x, f
        if abs(f) <= tolerance or abs(x2 - x1) <= least_width:
            break
        xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
        share = 0.5
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            share = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
        share = min(max(share, 1e-3), 1.0 - 1e-3)
    bracket[0], bracket[1] = min(x1, x2), max(x1, x2)
    if abs(f2) < abs(f1):
        x1, f1 = x2, f2
    for place in range(len(trial.weights)):
        trial.inputs[trial.first + place, p] = x1
    return f1


@entry
def find_common_pull(trial: Trial, target: float, limits: Array, tolerance: float, found: Array) -> None:
    """Find the pull of wire a that brings a weighted sum of the bends of endoscopes that have it in common.

    All endoscopes stand at the same command. The sum at the end of the next sample shall be `target` within
    a `tolerance` [rad], by a pull within `limits` (2,) [m]. `found` (4,) becomes the pull [m], the sum that
    it brings [rad], and its bracket [m]: the nearest that can be reached, and the end of the stroke where no
    pull leads as far, as endoscopes that stick move only after a longer travel.
    """
    reached = _find(trial, 0, target, limits, tolerance, found[2:])
    found[0], found[1] = trial.inputs[0, 0], reached
    if abs(reached - target) > tolerance:
        end = limits[1] if reached < target else limits[0]
        of_end = _bend_at(trial, 0, end)
        # An end beyond the target is none: there the bend jumps over it, as the counts of an encoder do.
        if (of_end - target) * (reached - target) >= 0.0:
            found[0], found[1] = end, of_end
