"""The lessons of a filter on simulated twins: set the gain, say how sure it is.

1. RAM (twins) learns the laws of the noise (`rl/twins/laws_lesson.py`).
2. Everything learns by back-propagation through the filter: an analytic policy gradient. Errors count
   as they do in the published figure (`rl/twins/balance.py`).
3. RAM (twins) learns what noise is like that of its training (`rl/twins/familiarity.py`).
4. The width of the interval learns by the pinball loss (Koenker and Bassett 1978): a quantile of |error|.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import torch

from rl.supervised import GRADIENT_LIMIT
from rl.twins.balance import SMALLEST_ERROR_DEG2, TypicalErrors, departure
from rl.twins.checkpoint import Keeper
from rl.twins.familiarity import Histograms
from rl.twins.filter_step import ALL, FilterStep, Output
from rl.twins.sequences import DrawsSequences, Sequences, SequenceSource
from rl.twins.settings import SimulatedTraining, TwinsTraining
from rl.twins.step import TwinsStep
from twin.errors import DivergedError
from twin.signals.streams import SeedUse, random_stream

OnUpdate = Callable[[int, float], None]
"""Told how many updates of a lesson are done, and its latest loss."""
COVERAGE = 0.95


def filter_sequences(
    step: FilterStep, drawn: Sequences, parts: torch.Tensor, state: Any = None
) -> Iterator[tuple[Output, Any]]:
    """Yield outputs and states sample by sample, from a state or from the start."""
    state = step.start(drawn.variance) if state is None else state
    told = drawn.variance, drawn.sample_time, parts
    for *inputs, measurement in zip(*drawn.inputs, drawn.measurement_deg, strict=True):
        output, state = step(*inputs, measurement, *told, state)
        yield output, state


def learn_what_is_familiar(step: TwinsStep, source: SequenceSource, settings: TwinsTraining) -> None:
    """Learn what the training's noises look like to the finished filter; from then on it is guarded."""
    rng = random_stream(settings.seed, SeedUse.LESSON_FAMILIARITY)
    step.goes_along = True
    half = max(min(128, settings.interval_sequences // 2), 1)
    found: tuple[list[Histograms], list[Histograms]] = ([], [])
    with torch.no_grad():
        for place, drawn, (_, state) in _finished(step, source, settings, rng, 2 * half):
            if place % 10 == 9:  # neighbours tell little more
                weights = step.bank.believe(state.evidence, drawn.variance).weights
                whole = Histograms(weights, state.counts, torch.log(drawn.variance))
                for part, rows in zip(found, (slice(half), slice(half, None)), strict=True):
                    part.append(Histograms(*(of[rows] for of in whole)))
    seen, held_out = (Histograms(*map(torch.cat, zip(*part, strict=True))) for part in found)

    def draw(count: int) -> torch.Tensor:
        return torch.as_tensor(rng.integers(len(seen.counts), size=count))

    step.familiarity.learn(seen, held_out, draw)
    step.guarded = True


def learn_gain(
    step: FilterStep,
    source: DrawsSequences,
    settings: SimulatedTraining,
    on_update: OnUpdate | None = None,
    keeper: Keeper | None = None,
) -> None:
    """Train all by back-propagation through the filter; a checkpoint is taken up."""
    typical = TypicalErrors(settings)
    if keeper:
        keeper.tables |= {"typical": typical.means, "met": typical.met}
    windows = settings.windows
    episode = windows * settings.window
    held: list[tuple[Sequences, Any]] = []

    def loss(update: int) -> torch.Tensor:
        place = update % windows
        if place == 0:
            rng = random_stream(settings.seed, SeedUse.LESSON_GAIN, update)
            whole = source.draw(settings.sequences, episode, rng)
            held[:] = [(whole, step.start(whole.variance))]
        whole, state = held[0]
        if place:  # the state is handed on to the next window, its history is not
            state = state._make(of.detach() for of in state)
        window = whole.between(place * settings.window, (place + 1) * settings.window)
        value, state = _window_loss(step, window, state, settings, typical, place)
        held[:] = [(whole, state)]
        return value

    parameters = dict(step.named_parameters())
    groups: list[dict[str, Any]] = [
        {"params": [of for name, of in parameters.items() if name not in step.slow]},
        {"params": [of for name, of in parameters.items() if name in step.slow], "share": 0.2},
    ]
    descend(groups, loss, settings.updates, settings.learning_rate, on_update, keeper)


def _window_loss(
    step: FilterStep,
    window: Sequences,
    state: Any,
    settings: SimulatedTraining,
    typical: TypicalErrors,
    place: int,
) -> tuple[torch.Tensor, Any]:
    """Return the loss of one window, and the state behind it."""
    squares, variances, likelihoods, departures = [], [], [], []
    of_bias = window.bias_deg / torch.sqrt(window.variance)
    for sample, (output, after) in enumerate(filter_sequences(step, window, ALL, state)):
        squares.append((output.bend_deg - window.truth_deg[sample]) ** 2)
        if step.by_likelihood:
            variances.append(output.deviation_deg**2)
        departures.append(departure(output.action, window.linear))
        if sample % 5 == 4:  # what is known of the noise hardly changes from sample to sample
            off = of_bias - output.bias
            likelihoods.append(off**2 / output.bias_variance + torch.log(output.bias_variance))
        state = after
    square = torch.stack(squares)
    if step.by_likelihood:
        variance = torch.stack(variances) + SMALLEST_ERROR_DEG2
        error = 0.5 * (square / variance + torch.log(variance)).mean()
    else:
        error = typical.loss(square.mean(dim=0) + SMALLEST_ERROR_DEG2, window, place)
    recognised = 0.5 * torch.stack(likelihoods).mean() if likelihoods else error.new_zeros(())
    departed = torch.stack(departures).mean()
    return error + settings.bias_weight * recognised + settings.linear_penalty * departed, state


def learn_interval(
    step: FilterStep, source: SequenceSource, settings: SimulatedTraining, on_update: OnUpdate | None = None
) -> None:
    """Train the width of the interval on errors of the finished filter; nothing else changes."""
    rng = random_stream(settings.seed, SeedUse.LESSON_INTERVAL)
    seen, errors = [], []
    with torch.no_grad():
        for place, drawn, (output, _) in _finished(
            step, source, settings, rng, min(256, settings.interval_sequences)
        ):
            if place % 5 == 0:  # neighbours tell little more
                off = (output.bend_deg - drawn.truth_deg[place]).abs() / output.deviation_deg
                seen.append(output.seen)
                errors.append(torch.log(off + 1e-3))
    features, error = torch.cat(seen), torch.cat(errors)

    def loss(update: int) -> torch.Tensor:
        rows = torch.as_tensor(rng.integers(len(error), size=2048))
        over = error[rows] - torch.log(step.widen(features[rows]))
        return torch.maximum(COVERAGE * over, (COVERAGE - 1) * over).mean()

    descend([{"params": list(step.interval.parameters())}], loss, settings.interval_updates, 1e-2, on_update)


def _finished(
    step: FilterStep,
    source: SequenceSource,
    settings: SimulatedTraining,
    rng: np.random.Generator,
    batch: int,
) -> Iterator[tuple[int, Sequences, tuple[Output, Any]]]:
    """Yield place, sequences, and output and state there, of whole episodes, so many of them at a time."""
    for _ in range(max(settings.interval_sequences // batch, 1)):
        drawn = source.draw(batch, settings.episode, rng)
        for place, reached in enumerate(filter_sequences(step, drawn, ALL)):
            yield place, drawn, reached


class Validation(NamedTuple):
    """Result of a step on held-out sequences.

    Attributes:
        loss: mean logarithm of the mean square error, at both ends of T.
        actions: of each action, as it is bounded, the mean and the standard deviation.
    """

    loss: float
    actions: list[float]


def validation(step: FilterStep, source: SequenceSource, settings: SimulatedTraining) -> Validation:
    """Return how a step does on held-out sequences; the same ones each time."""
    rng = random_stream(settings.seed, SeedUse.LESSON_VALIDATION)
    losses, actions = [], []
    for stride in (max(source.strides), min(source.strides)):
        drawn = source.draw(160, settings.episode, rng, stride)
        squares = []
        with torch.no_grad():
            for (output, _), truth in zip(filter_sequences(step, drawn, ALL), drawn.truth_deg, strict=True):
                squares.append((output.bend_deg - truth) ** 2)
                actions.append(torch.tanh(output.action))
        losses.append(float(torch.log(torch.stack(squares).mean(dim=0) + SMALLEST_ERROR_DEG2).mean()))
    loss, every = float(np.mean(losses)), torch.cat(actions)
    if not step.actions:
        return Validation(loss, [])
    told = torch.stack([every.mean(dim=0), every.std(dim=0)], dim=1)
    return Validation(loss, told.flatten().tolist())


def descend(
    groups: list[dict[str, Any]],
    loss: Callable[[int], torch.Tensor],
    updates: int,
    rate: float,
    on_update: OnUpdate | None,
    keeper: Keeper | None = None,
) -> None:
    """Take gradient steps by Adam; the learning rate falls to zero along a cosine.

    Raises:
        FloatingPointError: the loss is no number.
    """
    optimiser = torch.optim.Adam(groups, lr=rate, betas=(0.9, 0.99))
    parameters = [values for group in optimiser.param_groups for values in group["params"]]
    begin = keeper.restore(optimiser) if keeper else 0
    for update in range(begin, updates):
        for group in optimiser.param_groups:
            group["lr"] = rate * group.get("share", 1.0) * (1 + math.cos(math.pi * update / updates)) / 2
        value = loss(update)
        if not torch.isfinite(value):
            raise DivergedError(f"the training has diverged: the loss of update {update + 1} is no number")
        optimiser.zero_grad()
        value.backward()
        torch.nn.utils.clip_grad_norm_(parameters, GRADIENT_LIMIT)
        optimiser.step()
        if on_update:
            on_update(update + 1, value.item())
        if keeper:
            keeper.keep(update + 1, optimiser, last=update + 1 == updates)
