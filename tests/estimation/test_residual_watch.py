"""A residual that lasts is noticed, noise and a usual error of the model are not."""

import numpy as np
import pytest

from twin.estimation.residual_watch import ResidualWatch

T = 0.1


def watched(residuals) -> tuple[ResidualWatch, list[bool]]:
    watch = ResidualWatch(T)
    return watch, [watch.is_astray(float(residual)) for residual in residuals]


@pytest.mark.parametrize("noise_deg", [0.1, 1.0, 5.0])
def test_noise_alone_is_never_astray(noise_deg):
    noise = noise_deg * np.random.default_rng(1).standard_normal(50_000)
    assert not any(watched(noise)[1])


def test_a_usual_error_of_the_model_is_not_astray():
    slow = 4 * np.sin(2 * np.pi * np.arange(20_000) * T / 10)
    assert not any(watched(slow)[1])


def test_a_first_estimate_that_is_20_deg_off_is_not_astray():
    assert not any(watched(20 * np.exp(-np.arange(600) * T / 3))[1])


def test_an_error_that_begins_and_stays_is_noticed_and_its_size_is_known():
    quiet = 0.3 * np.random.default_rng(2).standard_normal(1000)
    watch, before = watched(quiet)
    after = [watch.is_astray(3.0) for _ in range(40)]
    assert not any(before)
    assert any(after)
    assert after.index(True) * T < 3.0
    assert watch.offset_deg == 3.0


def test_nothing_is_far_just_after_a_new_beginning():
    watch, _ = watched(np.zeros(3000))
    assert [watch.is_astray(5.0) for _ in range(40)].count(True) > 0
    watch.clear()
    assert not watch.is_astray(0.1)


@pytest.mark.parametrize("flagged", [True, False])
def test_what_follows_a_lie_does_not_become_usual(flagged):
    """Else a filter that the lie led astray would take the way back for its usual error."""
    watch, _ = watched(0.3 * np.random.default_rng(2).standard_normal(1000))
    if flagged:
        watch.doubt()
    for _ in range(30):
        watch.is_astray(-17.0)
    watch.clear()
    assert any(watch.is_astray(-2.0) for _ in range(30))


def test_a_model_that_is_wrong_from_now_on_is_usual_within_a_minute():
    quiet, wrong = np.zeros(1000), 8 * np.sin(2 * np.pi * np.arange(1200) * T / 10)
    watch, _ = watched(quiet)
    far = [watch.is_astray(float(residual)) for residual in wrong]
    assert any(far[:200])
    assert not any(far[600:])


def test_the_offset_is_that_of_now_where_the_residual_shrinks():
    watch, _ = watched(20 - 2 * np.arange(9.0))
    assert watch.offset_deg == pytest.approx(4.0)
