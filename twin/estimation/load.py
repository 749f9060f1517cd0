"""Loading any trained estimator, without torch: NumPy and ONNX Runtime run it."""

from pathlib import Path
from typing import Any

from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.estimator import Estimator, Sensor
from twin.estimation.learned.trained_file import TrainedFile, read_trained_file
from twin.estimation.registry import find_training
from twin.hysteresis import HysteresisModel
from twin.preset.sensor import SensorModel

SAME_S = 1e-9  # by which two sample times may differ


def load_estimator(path: str | Path | TrainedFile, sensor: Sensor | None = None) -> Estimator[Any]:
    """Return a trained estimator of any kind, from its file: a policy, a network, a learned gain.

    The estimator knows the model and the sample time that it was trained with (`estimator.sample_time`); one
    that was trained on twins runs at any, by `estimator.at(sample_time)`, and at 0.1 s without. It starts at
    rest, unless `begun` changes that. It needs your sensor, given here or by `with_sensor`.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged, or not a file that training wrote.
    """
    file = path if isinstance(path, TrainedFile) else read_trained_file(Path(path))
    try:
        training = find_training(file.agent)
    except ValueError as error:
        raise InputError(f"{file.path}: {error}") from None
    estimator: Estimator[Any] = training.load(file)
    return estimator if sensor is None else estimator.with_sensor(sensor)


def load_estimator_at(
    file: TrainedFile, sample_time: float | None, sensor: SensorModel | None = None
) -> tuple[Any, float]:
    """Return a trained estimator at a sample time, and that time [s].

    If it is not given, it is that of a sensor whose rate is known, for what was trained on twins, which runs
    at any; else that of the training.
    """
    estimator: Any = load_estimator(file)
    trained = float(estimator.sample_time)
    if sample_time is None and sensor and sensor.rate_hz and find_training(file.agent).on_twins:
        sample_time = 1 / sensor.rate_hz
    if sample_time is None or abs(sample_time - trained) < SAME_S:
        return estimator, trained
    return estimator.at(sample_time), sample_time


def model_of(path: str | Path) -> HysteresisModel:
    """Return the model of hysteresis that a trained file was trained with."""
    description = read_trained_file(Path(path)).description
    try:
        return ActiveModel.from_dict(description.get("active_model")).model
    except ValueError as error:
        raise InputError(f"{path} does not state the model that it was trained with: {error}") from error
