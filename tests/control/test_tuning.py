"""Tuning: every candidate is tried, the best is taken; of two as good the one that moves less."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from twin.control import comparison as tuning
from twin.control.comparison import tune
from twin.control.controller import Setting
from twin.errors import DivergedError


@pytest.fixture
def tried(monkeypatch):
    """Replace trials by a bowl about rate = 2 and gain = 0.05 on logarithmic scales; returns the tried."""
    seen = []

    def run_trial(name, knowledge, case):
        mine = knowledge.settings[name]
        seen.append(mine)
        off = math.log(mine["rate"] / 2) ** 2 + math.log(mine.get("gain", 0.05) / 0.05) ** 2
        return SimpleNamespace(rmse_deg=case * (0.1 + off), travel_mm=mine["rate"])

    monkeypatch.setattr(tuning, "run_trial", run_trial)
    monkeypatch.setattr(tuning.dataclasses, "replace", lambda _, settings: SimpleNamespace(settings=settings))
    return seen


KNOWLEDGE = SimpleNamespace(settings={"other": {"gain": 1.0}})
RATE, GAIN = Setting(1.0, 0.1, 40.0), Setting(0.2, 0.001, 1.0)


def test_as_many_are_tried_as_is_said_on_all_cases_and_within_the_range(tried):
    found = tune("toy", {"rate": RATE, "gain": GAIN}, [(KNOWLEDGE, 1.0), (KNOWLEDGE, 2.0)], 16, 3)
    assert (found.tried, len(tried)) == (16, 32)
    assert tried[0] == pytest.approx({"rate": 1.0, "gain": 0.2})  # the default is the first
    rates, gains = (np.array([of[name] for of in tried]) for name in ("rate", "gain"))
    assert RATE.low * (1 - 1e-9) <= rates.min() < rates.max() <= RATE.high * (1 + 1e-9)
    assert GAIN.low * (1 - 1e-9) <= gains.min() < gains.max() <= GAIN.high * (1 + 1e-9)


def test_a_setting_that_may_be_zero_is_tried_evenly_from_zero_on(tried):
    tune("toy", {"rate": RATE, "lead_s": Setting(0.0, 0.0, 2.0)}, [(KNOWLEDGE, 1.0)], 40, 3)
    leads = np.array([of["lead_s"] for of in tried])
    assert leads[0] == leads.min() == 0.0
    assert leads.max() <= 2.0
    assert np.median(leads[:30]) == pytest.approx(1.0, abs=0.15)


def test_the_error_is_the_geometric_mean_over_cases(tried):
    found = tune("toy", {"rate": RATE}, [(KNOWLEDGE, 3.0), (KNOWLEDGE, 4.0)], 1, 0)
    alone = 0.1 + math.log(2) ** 2
    assert found.rmse_deg == pytest.approx(alone * math.sqrt(3 * 4))


@pytest.mark.parametrize("diverges_below", [0.0, 3.0])
def test_of_those_that_are_about_as_good_and_do_not_diverge_the_least_travel_is_taken(
    monkeypatch, diverges_below
):
    def run_trial(name, knowledge, case):
        rate = knowledge.settings[name]["rate"]
        if rate < diverges_below:
            raise DivergedError("no equilibrium")
        return SimpleNamespace(rmse_deg=1.0 if rate > 5 else 1.04 if rate > 2 else 2.0, travel_mm=rate)

    monkeypatch.setattr(tuning, "run_trial", run_trial)
    monkeypatch.setattr(tuning.dataclasses, "replace", lambda _, settings: SimpleNamespace(settings=settings))
    found = tune("toy", {"rate": RATE}, [(KNOWLEDGE, 1.0)], 64, 0)
    least = max(2.0, diverges_below)
    assert least < found.settings["rate"] < least + 1
    assert found.rmse_deg == 1.04
