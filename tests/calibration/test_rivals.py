"""Models without physics, as rivals of a calibration: each finds itself, its zero and its delay."""

import dataclasses

import numpy as np
import pytest
from calibrating import changed
from models import NAMES

from twin.calibration.compared import rival_errors
from twin.calibration.logs import MeasuredLoop
from twin.episode import Episode
from twin.hysteresis import BoucWen, ColemanHodgdon, PrandtlIshlinskii

STEP = 0.05
TIME = np.arange(0, 20, STEP)
PULL = 3.0 * np.sin(2 * np.pi * TIME / 7) * (1 - TIME / 60)  # [mm]
TRUTH = {
    "coleman-hodgdon": ColemanHodgdon(0.8, 12.0, 8.0),
    "bouc-wen": BoucWen(9.0, -8.0, 0.9, 0.8, 1.5),
    "prandtl-ishlinskii": PrandtlIshlinskii((2.0, 5.0, 3.0), (0.0, 0.6, 1.1)),
}


def made(pull, bend, sheath: float | None = None) -> Episode:
    nothing = np.empty((len(pull), 2, 0))
    sheath_bend = np.empty(0) if sheath is None else np.full(len(pull), sheath)
    time = STEP * np.arange(len(pull))
    return Episode(time, pull, bend, bend, nothing[:, 0], nothing, nothing, sheath_bend=sheath_bend)


def log_of(
    name: str, pull: np.ndarray = PULL, *, zero: float = 0.0, bend: float | None = 0.0, **more
) -> MeasuredLoop:
    """A log that one of the models made, its angle `zero` degrees too high."""
    fields = {
        "name": name,
        "episode": made(pull * 1e-3, np.radians(TRUTH[name].response(pull, 0.0) + zero), bend),
        "fitted": np.ones(len(pull), bool),
        "seen": np.ones(len(pull), bool),
        "offset": True,
    }
    return MeasuredLoop(**fields | more)


def rmse_deg(error: np.ndarray | None) -> float:
    assert error is not None
    return float(np.degrees(np.sqrt(np.mean((error - error.mean()) ** 2))))


@pytest.mark.parametrize("name", NAMES)
def test_a_model_finds_itself_whatever_the_zero_of_the_angle(name):
    (error,) = rival_errors(name, [log_of(name, zero=25.0)], seed=0)
    # Thresholds of plays are spread evenly, and not those of the truth.
    assert rmse_deg(error) < (0.4 if name == "prandtl-ishlinskii" else 0.02)


@pytest.mark.parametrize("name", NAMES)
def test_a_delay_of_the_command_is_found_where_times_were_recorded(name):
    late = log_of(name, np.interp(TIME - 0.15, TIME, PULL))
    late = changed(late, pull=PULL * 1e-3)
    blind, timed = (
        rival_errors(name, [dataclasses.replace(late, timed=timed)], 0)[0] for timed in (False, True)
    )
    assert rmse_deg(timed) < 0.4
    assert rmse_deg(timed) < 0.6 * rmse_deg(blind) or name == "prandtl-ishlinskii"


def test_only_the_fitted_part_is_learned_from():
    half = np.arange(len(TIME)) < len(TIME) // 2
    whole = log_of("coleman-hodgdon", fitted=half)
    bend = whole.episode.bend
    other = changed(whole, bend=np.where(half, bend, bend + 0.3))
    first, second = (rival_errors("coleman-hodgdon", [log], seed=0)[0] for log in (whole, other))
    np.testing.assert_allclose(second, np.where(half, first, first - 0.3), atol=1e-12)
    assert rmse_deg(first) < 0.02


def test_each_bend_of_the_sheath_has_its_own_model_and_the_nearest_predicts_another():
    straight = log_of("coleman-hodgdon", bend=0.0)
    bent = log_of("coleman-hodgdon", bend=3.0)
    bent = changed(bent, bend=bent.episode.bend / 2)
    unseen = changed(bent, sheath_bend=np.full(len(TIME), 2.0)).only_predicted()
    errors = rival_errors("coleman-hodgdon", [straight, unseen, bent], seed=0)
    assert [rmse_deg(error) < 0.02 for error in errors] == [True] * 3
    far = changed(unseen, sheath_bend=np.full(len(TIME), 1.0))
    assert rmse_deg(rival_errors("coleman-hodgdon", [straight, far, bent], seed=0)[1]) > 2


def test_a_lateral_plane_is_fitted_alone_and_without_motion_nothing_is_said():
    log = log_of("coleman-hodgdon")
    bend, pull = log.episode.bend, log.episode.pull
    sideways = changed(log, lateral_bend=bend, lateral_pull=pull, bend=0 * bend)
    assert rmse_deg(rival_errors("coleman-hodgdon", [sideways, log], 0, plane=1)[0]) < 0.02
    assert rival_errors("coleman-hodgdon", [sideways, log], 0, plane=1)[1] is None
    still = changed(log, lateral_bend=bend)
    assert rival_errors("coleman-hodgdon", [still], 0, plane=1) == [None]
    assert rival_errors("coleman-hodgdon", [log.only_predicted()], 0) == [None]
