"""The measurements of datasets, on a small endoscope: what they compare, not how fast this machine is."""

import functools

import pytest
from small_dataset import SMALL

from twin.benchmark import datasets

STROKE = 1e-3  # [m]
SECONDS = 6.0  # of an episode, instead of 60


@pytest.fixture(autouse=True)
def short_episodes(monkeypatch):
    monkeypatch.setattr(datasets, "_recipe", functools.partial(datasets._recipe, seconds=SECONDS))
    monkeypatch.setattr(datasets, "AT_ONCE", 2)


def test_logging_is_compared_with_the_simulation_in_the_same_unit(monkeypatch):
    def clock(make, simulate):
        make()
        simulate()
        return 1.1, 1.0  # seconds, as if it had measured them

    monkeypatch.setattr(datasets, "in_turn", clock)
    result = datasets.logging(SMALL, STROKE)
    assert result.unit == "s per simulated minute"
    assert (result.value, result.peer_value) == pytest.approx((0.1 / 2, 1 / 2))
    assert result.ratio == pytest.approx(0.1)
    assert result.holds


def test_dataset_is_made_by_two_and_by_one_weighed_and_read(monkeypatch):
    monkeypatch.setattr(datasets, "TURNS", 1)
    told = []
    results = datasets.dataset(SMALL, STROKE, 2, lambda *progress: told.append(progress))
    assert told[-1] == (4, 4)
    rate = results["dataset_two_cores"]
    assert rate.holds == (rate.ratio >= 1.7)
    # Per minute at 50 Hz: some numbers of eight bytes, compressed, in each sample
    assert 0.05 < results["dataset_size"].value < 3
    assert results["dataset_reading"].value > 0


def test_both_twins_make_the_dataset_by_either_clock(monkeypatch):
    made = []
    write = datasets._write
    monkeypatch.setattr(
        datasets, "_write", lambda recipe, *rest: made.append(recipe.physics) or write(recipe, *rest)
    )
    results = datasets.by_the_reduced_twin(SMALL, STROKE, 2)
    assert made == ["reduced", "reduced", "mujoco"]
    assert list(results) == ["dataset_reduced", "dataset_reduced_processor"]
    for result in results.values():
        assert result.value > 0
        assert result.holds == (result.ratio >= 8)
