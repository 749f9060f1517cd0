"""RAM (twins) under five kinds of noise that its training never saw, compared with a tuned filter."""

import numpy as np
import pytest
from small_twins import twins

from rl.on_twins import train_ram_twins
from rl.options import EPISODES, TrainingOptions
from rl.twins.members import draw_members
from rl.twins.records import SAMPLE_TIME, STRIDES, simulate_records
from rl.twins.settings import TwinsTraining
from twin.estimation.estimator import Sensor
from twin.estimation.knowledge import Knowledge
from twin.estimation.load import load_estimator
from twin.estimation.registry import find_method, needed_fits
from twin.hysteresis import ColemanHodgdon
from twin.identification import identify
from twin.reduced.members import MemberSet

T = SAMPLE_TIME * STRIDES[0]
SEED = 1
OTHER_SEED = 4321  # of twins and commands that no training saw


def drifting(shape, rng):
    return rng.standard_normal(shape) + np.cumsum(0.05 * rng.standard_normal(shape), axis=1), 1.0


def correlated(shape, rng):
    noise = rng.standard_normal(shape)
    for k in range(1, shape[1]):
        noise[:, k] = 0.9 * noise[:, k - 1] + np.sqrt(1 - 0.9**2) * noise[:, k]
    return noise, 1.0


def dropping_out(shape, rng):
    noise = rng.standard_normal(shape)
    for row in noise:
        for start in rng.integers(0, shape[1], 12):
            row[start : start + rng.integers(5, 25)] = np.nan
    return noise, 1.0


def one_sided_outliers(shape, rng):
    outliers = 8 * (rng.uniform(size=shape) < 0.08)
    return 0.4 * rng.standard_normal(shape) + outliers, 0.16 + 64 * 0.08 * 0.92


def quantised(shape, rng):
    return None, 1.0 / 12  # to whole degrees


@pytest.fixture(scope="module")
def records():
    """Nominal and randomised twins along commands of every kind: pull [mm] and bend [deg], thinned to T."""
    preset, ranges = twins()
    drawn = draw_members(preset, ranges, 4, OTHER_SEED).presets
    pulls, members, _ = simulate_records(
        preset, ranges, MemberSet.still([preset, *drawn]), commands=10, twins=1, seconds=60.0, seed=OTHER_SEED
    )
    pull = np.repeat(pulls, 5, axis=0)[:, :: STRIDES[0]].astype(float)
    bend = members.reshape(-1, pulls.shape[1])[:, :: STRIDES[0]].astype(float)
    return pull, bend


@pytest.fixture(scope="module")
def tuned():
    """The tuned filter, on the paper's kind of training records of the preset."""
    preset, ranges = twins()
    pulls, members, _ = simulate_records(
        preset, ranges, MemberSet.still([preset]), commands=5, twins=1, seconds=60.0, seed=SEED
    )
    known = [
        (pull[:: STRIDES[0]].astype(float), bend[0, :: STRIDES[0]].astype(float))
        for pull, bend in zip(pulls, members, strict=True)
    ]
    model, _ = identify(known, SEED)
    spec = find_method("AM-tuned (Q, R)")
    knowledge = Knowledge(sample_time=T, models={ColemanHodgdon.name: model}, records=known, seed=SEED)
    fits = {fit.key: fit.find(knowledge) for fit in needed_fits([spec])}
    return spec.build(Knowledge(T, knowledge.models, records=known, seed=SEED, fits=fits))


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A quarter of a full training."""
    settings = TwinsTraining().scaled(TrainingOptions(episodes=EPISODES // 4, seed=SEED))
    return load_estimator(train_ram_twins(*twins(), settings, tmp_path_factory.mktemp("ram_twins")))


@pytest.mark.slow
@pytest.mark.parametrize("family", [drifting, correlated, dropping_out, one_sided_outliers, quantised])
def test_it_is_not_worse_than_a_tuned_filter(family, trained, tuned, records):
    pull, bend = records
    noise, variance = family(bend.shape, np.random.default_rng(SEED))
    measurement = np.round(bend) if noise is None else bend + noise
    sensor = Sensor(variance, zero_deviation_deg=0.0)
    errors = [
        filter_.with_sensor(sensor).estimate(pull, measurement, bend[:, 0] + 20) - bend
        for filter_ in (trained, tuned)
    ]
    learned, rival = (np.sqrt((error[:, 1:] ** 2).mean()) for error in errors)
    assert learned <= rival, f"{learned:.2f} deg against {rival:.2f} deg"
