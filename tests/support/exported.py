"""A recurrent network or a filter's step of torch, and the graph that is exported of it."""

import copy
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import torch
from small_twins import generator, small_memory_source

from rl.supervised import tensor32
from rl.twins.filter_step import ALL, FilterStep
from rl.twins.graph import StepGraph
from rl.twins.records import Sequences
from twin.estimation.estimator import Sensor
from twin.estimation.learned.step import LearnedStep
from twin.estimation.learned.trained_file import TrainedFile


def filtered_by_both(
    graph: StepGraph,
    file: TrainedFile,
    names: Sequence[str],
    drawn: Sequences,
    samples: int,
    is_missing: Callable[[int], bool],
    precision: torch.dtype = torch.float64,
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield what the exported graph and torch say of each sample, (2, B) estimate and half of the interval.

    Both begin at a state of zeros, and each goes on from its own.

    Args:
        graph: the trained step with plain arrays in and out.
        file: the exported graph.
        names: of what it predicts by, then of its state.
        drawn: sequences; behind their end they begin again.
        samples: how many, in all.
        is_missing: whether the first filter has no measurement at a sample.
        precision: of torch.
    """
    of_torch = [torch.zeros_like(of, dtype=precision) for of in graph.step.start(drawn.zero_deviation_deg)]
    graph = copy.deepcopy(graph).to(precision)
    of_onnx = [of.numpy() for of in of_torch]
    predicted_by, state = names[: len(drawn.inputs)], names[len(drawn.inputs) :]
    for k in range(samples):
        place = k % len(drawn.measurement_deg)
        measurement = drawn.measurement_deg[place].clone()
        if is_missing(k):
            measurement[0] = torch.nan
        values = (
            *(of[place] for of in drawn.inputs),
            measurement,
            drawn.variance,
            drawn.zero_deviation_deg,
            drawn.sample_time,
            torch.ones(2),
        )
        values = tuple(of.to(precision) for of in values)
        with torch.no_grad():
            bend, half_width, *of_torch = graph(*values, *of_torch)
        of_sample = ("measurement_deg", "variance", "zero_deviation_deg", "sample_time", "parts")
        fed = dict(zip((*predicted_by, *of_sample), (of.numpy() for of in values), strict=True))
        found = file.run(**fed, **dict(zip(state, of_onnx, strict=True)))
        of_onnx = found[2:]
        yield np.array(found[:2]), torch.stack([bend, half_width]).numpy()


def said_by_both(step: FilterStep, estimator: LearnedStep) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield what an estimator and its step say of whole records, (2, B, N) estimate and half of the interval.

    One record and several, the first of which lacks measurements.
    """
    source = small_memory_source()
    for count in (1, 4):
        command, index = np.arange(count), np.arange(0, 31 * 5, 5)[:, None]
        pull = source.records[0][command, index].astype(float)
        measurement = pull * 20 + generator(count).standard_normal(pull.shape)
        measurement[8:10, 0] = np.nan
        variance, unknown = np.linspace(0.3, 2.0, count), np.linspace(0.0, 3.0, count)
        inputs = source.predict(source.records, command, index)
        given = tensor32(variance), tensor32(unknown), torch.full((count,), 0.1), ALL
        state, wanted = step.start(given[1]), []
        with torch.no_grad():
            for *by, y in zip(*inputs, tensor32(measurement[1:]), strict=True):
                output, state = step(*by, y, *given, state)
                wanted.append(torch.stack([output.bend_deg, output.half_width_deg]))
        sensed = estimator.with_sensor(Sensor(variance, unknown))
        found = sensed.estimate_with_interval(pull.T, measurement.T, 0.0)
        yield np.array(found)[:, :, 1:], torch.stack(wanted).permute(1, 2, 0).numpy()
