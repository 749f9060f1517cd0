"""A residual that lasts is found; noise and a usual error of the model are not."""

import numpy as np
import pytest

from twin.live.checks import BiasDetector, OffsetDetector

T = 0.1
QUIET = 0.3 * np.random.default_rng(2).standard_normal(1000)


def detected(residuals) -> tuple[BiasDetector, list[bool]]:
    detector = BiasDetector(T)
    return detector, [detector.is_biased(float(residual)) for residual in residuals]


@pytest.mark.parametrize(
    "residuals",
    [
        *(noise_deg * np.random.default_rng(1).standard_normal(20_000) for noise_deg in (0.1, 1.0, 5.0)),
        4 * np.sin(2 * np.pi * np.arange(10_000) * T / 10),  # a usual error of the model
        20 * np.exp(-np.arange(600) * T / 3),  # a first estimate that is 20 deg off
    ],
    ids=("quiet", "noisy", "loud", "model", "first"),
)
def test_usual_residual_is_no_bias(residuals):
    assert not any(detected(residuals)[1])


def test_error_that_begins_and_stays_is_found_with_its_size():
    detector, before = detected(QUIET)
    after = [detector.is_biased(3.0) for _ in range(40)]
    assert not any(before)
    assert after.index(True) * T < 3.0
    assert detector.offset_deg == 3.0
    detector.clear()
    assert not detector.is_biased(0.1)


@pytest.mark.parametrize("flagged", [True, False])
def test_what_follows_a_fault_does_not_become_usual(flagged):
    """Otherwise a filter that the fault has biased would take its recovery for a usual error."""
    detector, _ = detected(QUIET)
    if flagged:
        detector.doubt()
    for _ in range(30):
        detector.is_biased(-17.0)
    detector.clear()
    assert any(detector.is_biased(-2.0) for _ in range(30))


def test_an_offset_is_one_that_stays_and_ends_when_it_has_been_small_for_long():
    detector = OffsetDetector(0.1)
    assert not any(detector.is_off(2.0, 0.1) for _ in range(9))
    assert detector.is_off(-0.1, 0.1) is False
    assert [detector.is_off(2.0 + 0.1 * k, 0.1) for k in range(10)] == [False] * 9 + [True]
    assert detector.offset_deg == pytest.approx(2.9)
    assert all(detector.is_off(1.0, 0.5) for _ in range(100))  # it is uncertain, but has not gone
    assert all(detector.is_off(0.1, 0.1) for _ in range(49))
    assert not detector.is_off(0.1, 0.1)
    detector.is_off(0.1, 0.1)
    assert detector.offset_deg == 0
    assert not any(detector.is_off(2.0, 1.0) for _ in range(50))  # within four deviations
