"""Loading one trained file into a running, assured estimator."""

import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from twin.errors import InputError
from twin.estimation.estimator import Sensor
from twin.estimation.health import StreamLimits
from twin.estimation.learned.trained_file import TrainedFile, read_trained_file
from twin.estimation.load import load_estimator_at
from twin.estimation.real_number import real_number
from twin.estimation.registry import method_specs
from twin.runtime.assured import AssuredEstimator
from twin.runtime.deployment import KEY, Deployment


def load_runtime(
    path: str | Path,
    *,
    sample_time: float | None = None,
    noise_variance: float | None = None,
    initial_bend_deg: float = 0.0,
    limits: StreamLimits | None = None,
) -> AssuredEstimator:
    """Read a trained file and return its estimator, ready for the first sample.

    Args:
        path: the file that training wrote.
        sample_time: T [s]; that of the training, if not given. What was trained on twins runs at any.
        noise_variance: R of the sensor [deg^2]; that of the training, if not given.
        initial_bend_deg: estimate at the first sample [deg].
        limits: beyond which a sample is not believed.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, not a file that training wrote, or cannot run at this sample time.
    """
    prepared = prepare_runtime(path, sample_time=sample_time, noise_variance=noise_variance, limits=limits)
    return prepared(initial_bend_deg)


def prepare_runtime(
    path: str | Path,
    *,
    sample_time: float | None = None,
    noise_variance: float | None = None,
    limits: StreamLimits | None = None,
) -> Callable[[float], AssuredEstimator]:
    """Read a trained file once for many streams; arguments and errors are those of `load_runtime`.

    Returns:
        What makes the estimator of a stream, ready for its first sample, from its initial estimate [deg].
    """
    path = Path(path)
    file = read_trained_file(path)
    deployment = deployment_of(file)
    if sample_time is not None:
        sample_time = _positive("sample_time", sample_time)
    if noise_variance is None:
        noise_variance = float(np.asarray(deployment.fallback.measurement_variance))
    noise_variance = _positive("noise_variance", noise_variance)
    estimator, T = load_estimator_at(path, file.agent, sample_time)
    advanced = estimator.with_sensor(Sensor(noise_variance))
    method = next(spec.name for spec in method_specs() if spec.training and spec.training.agent == file.agent)
    return functools.partial(AssuredEstimator, method, advanced, deployment, T, noise_variance, limits=limits)


def deployment_of(file: TrainedFile) -> Deployment:
    """Return the fallback of a trained file, and the limits of its training.

    Raises:
        ValueError: it holds none, or one that cannot be.
    """
    if KEY not in file.description:
        raise InputError(f"{file.path} holds no fallback: an earlier version wrote it; train again")
    try:
        return Deployment.from_dict(file.description[KEY])
    except ValueError as error:
        raise InputError(f"{file.path} cannot be deployed: {error}") from error


def _positive(name: str, value: Any) -> float:
    number = real_number(name, value)
    if not 0 < number < math.inf:
        raise InputError(f"{name} = {number:g}: must be positive and finite")
    return number
