"""Weights that the bank of RAM (twins) gives its members: how their bends add up to what it foretells.

The graph of a trained file foretells mean + (theta - mean) . D c + d of the members' angles theta, where c is
the mean of the coefficients that its state has for each law of the noise, weighed by how likely the laws are.
D, and how likely they are before anything is measured, are constants inside of the graph. They are found by
asking: without a measurement, the graph returns what it foretells, which is linear in theta, c and d.
"""

import numpy as np
from numpy.typing import NDArray

from twin.estimation.learned.ram_twins import STATE, RamTwins, TwinsState

Array = NDArray[np.float64]
_ROWS, _EVIDENCE = (list(STATE).index(name) for name in ("rows", "evidence"))
_COVARIANCES = [list(STATE).index(name) for name in ("covariance", "rows_covariance")]


class MemberWeights:
    """Weights of M members by the state of a filter.

    Attributes:
        directions: (M, r) D, with the mean over the members taken off.
        log_prior: (J,) logarithm of how likely each law is before anything is measured.
    """

    def __init__(self, estimator: RamTwins) -> None:
        """Ask the graph of an estimator, for its R.

        Args:
            estimator: of one stream.
        """
        laws, size = estimator.network.state["rows"]
        members, directions = len(estimator.twins.presets), size - 1  # the last number is d
        coefficients = np.tile(np.eye(directions, size), (members, 1))
        one = np.repeat(np.eye(members), directions, axis=0)
        told = _foretold(estimator, np.repeat(coefficients[:, None], laws, axis=1), one)
        self.directions: Array = told.reshape(members, directions) - 1 / members
        of_error = np.zeros((laws, laws, size))
        of_error[range(laws), range(laws), -1] = 1.0
        self.log_prior: Array = np.log(_foretold(estimator, of_error, np.zeros((laws, members))))

    def of(self, state: TwinsState) -> Array:
        """Return the (M,) weights of the one filter of a state; their sum is 1."""
        rows, evidence = (np.asarray(state.memory[place][0], float) for place in (_ROWS, _EVIDENCE))
        believed = self.log_prior + evidence
        likely = np.exp(believed - believed.max())
        coefficients = likely @ rows[:, :-1] / likely.sum()
        weights: Array = 1 / len(self.directions) + self.directions @ coefficients
        return weights


def _foretold(estimator: RamTwins, rows: Array, members_deg: Array) -> Array:
    """Return (B,) angles that the graph foretells by rows (B, J, n), nothing being measured [deg]."""
    batch = len(rows)
    memory = [of.copy() for of in estimator.network.start(batch)]
    # Any covariance that is not zero: a state of zeros would be taken for one that has not begun.
    for place in _COVARIANCES:
        memory[place][:] = np.eye(memory[place].shape[-1])
    memory[_ROWS][:] = rows
    told, _, _ = estimator.network.step(
        tuple(memory),
        np.full(batch, np.nan),
        np.ravel(estimator.measurement_variance)[0],
        estimator.sample_time,
        members_deg=members_deg,
        way_mm=np.zeros(batch),
    )
    return told
