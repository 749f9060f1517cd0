"""The lessons of a filter on simulated twins: its gain, and the width of its interval.

1. RAM (twins) learns its noise models (`learn_noise_models`), and to detect noise unlike them
   (`fit_ood_detector`). No filter is needed for the first.
2. Others learn by back-propagation through the filter: an analytic policy gradient. Errors count as they do
   in the published figure (`TypicalErrors`).
3. The width of the interval learns by the pinball loss (Koenker and Bassett 1978): a quantile of |error|.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rl.run import Keeper
from rl.supervised import OnUpdate, descend
from rl.twins.filter_bank import NoiseModelParameters, log_density
from rl.twins.filter_step import ALL, FilterStep, Output
from rl.twins.noises import draw_noises
from rl.twins.ood_detector import Histograms
from rl.twins.records import SITUATIONS, STRIDES, Sequences, SequenceSource
from rl.twins.settings import NetworkTraining, SimulatedTraining, TwinsTraining
from rl.twins.step import TwinsStep
from twin.signals.streams import SeedUse, random_stream

POWER = 0.7  # errors squared grow with R to about this power: one R counts as much as another
RECORD_S = 60.0  # the last window stands for all that follows in a record of this length,
MOST_LAST = 12  # but for no more windows than this
SMALLEST_ERROR_DEG2 = 1e-3  # added to square errors: their logarithm stays finite
_SLOWEST = 0.05  # weight of a new mean among those before


class TypicalErrors:
    """Running means of errors squared over R^0.7, by family, sample time and window."""

    def __init__(self, settings: NetworkTraining):
        shape = (len(settings.noises) + len(SITUATIONS), len(STRIDES), settings.windows)
        self.window = settings.window
        self.means: NDArray[np.float64] = np.zeros(shape)  # zero where none has occurred
        self.met: NDArray[np.float64] = np.zeros(shape)  # number of occurrences

    def loss(self, square_deg2: torch.Tensor, window: Sequences, place: int) -> torch.Tensor:
        """Return the balanced loss of one window, and add it to the means; arguments as in `meet`."""
        self.meet(square_deg2.detach(), window, place)
        return (self.factors(window, place) * square_deg2).mean()

    def meet(self, square_deg2: torch.Tensor, window: Sequences, place: int) -> None:
        """Update the means by (B,) mean square errors of sequences in a window [deg^2]."""
        scaled = square_deg2 / window.variance**POWER
        for family in torch.unique(window.family).tolist():
            where = family, STRIDES.index(window.stride), place
            square = float(scaled[window.family == family].mean())
            self.met[where] += 1
            self.means[where] += max(1 / self.met[where], _SLOWEST) * (square - self.means[where])

    def factors(self, window: Sequences, place: int) -> torch.Tensor:
        """Return (B,) the weights of the square errors [deg^2] of sequences.

        A family that has not yet occurred at this sample time counts as the mean of those that have.
        """
        stride = STRIDES.index(window.stride)
        weights = self._weights(float(window.sample_time[0]))
        factors = torch.zeros_like(window.variance)
        all_met = self.means[:, stride][self.met[:, stride] > 0]
        usual = float(all_met.mean()) if len(all_met) else 1.0
        for family in torch.unique(window.family).tolist():
            means, met = self.means[family, stride], self.met[family, stride] > 0
            total = weights @ np.where(met, means, means[met].mean() if met.any() else usual)
            factors[window.family == family] = len(weights) * weights[place] / total
        return factors / window.variance**POWER

    def _weights(self, sample_time: float) -> NDArray[np.float64]:
        weights = np.ones(self.means.shape[2])
        rest = RECORD_S / (self.window * sample_time) - len(weights) + 1
        weights[-1] = min(max(rest, 1.0), MOST_LAST)
        return weights


def departure(action: torch.Tensor, linear: torch.Tensor) -> torch.Tensor:
    """Return (B,) how far gain and R, the first two actions, depart from the best, a linear update."""
    return linear * (torch.tanh(action[:, :2]) ** 2).sum(dim=1)


COVERAGE = 0.95


def filter_sequences(
    step: FilterStep, drawn: Sequences, parts: torch.Tensor, state: Any = None
) -> Iterator[tuple[Output, Any]]:
    """Yield outputs and states sample by sample, from a state or from the start."""
    state = step.start(drawn.zero_deviation_deg) if state is None else state
    given = drawn.variance, drawn.zero_deviation_deg, drawn.sample_time, parts
    for *inputs, measurement in zip(*drawn.inputs, drawn.measurement_deg, strict=True):
        output, state = step(*inputs, measurement, *given, state)
        yield output, state


def fit_ood_detector(step: TwinsStep, source: SequenceSource, settings: TwinsTraining) -> None:
    """Fit the detector to the training's noises as the finished filter sees them, and switch it on."""
    rng = random_stream(settings.seed, SeedUse.LESSON_FAMILIARITY)
    half = max(min(128, settings.interval_sequences // 2), 1)
    found: tuple[list[Histograms], list[Histograms]] = ([], [])
    with torch.no_grad():
        for place, drawn, (_, state) in _finished(step, source, settings, rng, 2 * half):
            if place % 10 == 9:  # neighbours add little
                weights = step.filter_bank.believe(state.evidence, drawn.variance)
                whole = Histograms(weights, state.counts, torch.log(drawn.variance))
                for part, rows in zip(found, (slice(half), slice(half, None)), strict=True):
                    part.append(Histograms(*(of[rows] for of in whole)))
    seen, held_out = (Histograms(*map(torch.cat, zip(*part, strict=True))) for part in found)

    def draw(count: int) -> torch.Tensor:
        return torch.as_tensor(rng.integers(len(seen.counts), size=count))

    step.ood_detector.learn(seen, held_out, draw)
    step.guarded = True


def learn_gain(
    step: FilterStep,
    draw: Callable[[int, int, np.random.Generator], Sequences],
    settings: NetworkTraining,
    on_update: OnUpdate | None = None,
    keeper: Keeper | None = None,
) -> None:
    """Train all by back-propagation through the filter, from the checkpoint if there is one.

    `draw` returns a number of sequences of a number of samples, like a `SequenceSource`.
    """
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
            whole = draw(settings.sequences, episode, rng)
            held[:] = [(whole, step.start(whole.zero_deviation_deg))]
        whole, state = held[0]
        if place:  # the state is handed on to the next window, its history is not
            state = state._make(of.detach() for of in state)
        window = whole.between(place * settings.window, (place + 1) * settings.window)
        value, state = _window_loss(step, window, state, settings, typical, place)
        held[:] = [(whole, state)]
        return value

    groups: list[dict[str, Any]] = [{"params": list(step.parameters())}]
    descend(groups, loss, settings.updates, settings.learning_rate, on_update, keeper)


def _window_loss(
    step: FilterStep,
    window: Sequences,
    state: Any,
    settings: NetworkTraining,
    typical: TypicalErrors,
    place: int,
) -> tuple[torch.Tensor, Any]:
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
            if place % 5 == 0:  # neighbours add little
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
    for _ in range(max(settings.interval_sequences // batch, 1)):
        drawn = source.draw(batch, settings.episode, rng)
        for place, reached in enumerate(filter_sequences(step, drawn, ALL)):
            yield place, drawn, reached


def validation(
    step: FilterStep, source: SequenceSource, settings: SimulatedTraining
) -> tuple[float, list[float]]:
    """Return the loss on held-out sequences, the same ones each time, and the moments of each action.

    The loss is the mean logarithm of the mean square error, at both ends of T; moments are mean and standard
    deviation of each action as it is bounded.
    """
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
        return loss, []
    moments = torch.stack([every.mean(dim=0), every.std(dim=0)], dim=1)
    return loss, moments.flatten().tolist()


Tensor = torch.Tensor

BATCH, SAMPLES = 512, 24  # sequences of one update, and samples of each
_LENGTH = 96  # of a sequence that they are taken from
_DOUBT = (0.01, 0.55)  # variance of the belief that smears a sample, in units of R
_OF_INFORMATION = 0.3  # weight of that loss relative to the likelihood


def learn_noise_models(
    noise_models: NoiseModelParameters, settings: TwinsTraining, on_update: OnUpdate | None = None
) -> None:
    """Learn the density of each noise model, its frequency, and the information of its samples."""
    rng = random_stream(settings.seed, SeedUse.LESSON_LAWS)
    noise = draw_noises(settings.known_noises, settings.noise_model_sequences, _LENGTH, rng)
    known = noise.noise_model >= 0  # of the others the bank has no model
    variance = torch.as_tensor(noise.variance[known]).float()
    noise_model = torch.as_tensor(noise.noise_model[known])
    residual = torch.as_tensor(noise.noise_deg[known]).float() / torch.sqrt(variance)[:, None]
    least, most = map(math.log, _DOUBT)

    def loss(update: int) -> Tensor:
        rows = torch.as_tensor(rng.integers(len(noise_model), size=BATCH))
        chosen = torch.as_tensor(rng.integers(_LENGTH, size=SAMPLES))
        doubt = torch.exp(torch.as_tensor(rng.uniform(least, most, (BATCH, 1))).float())
        smeared = torch.as_tensor(rng.standard_normal((BATCH, SAMPLES))).float() * torch.sqrt(doubt)
        return noise_models_loss(
            noise_models,
            noise_model[rows],
            variance[rows],
            residual[rows][:, chosen] + smeared,
            doubt,
        )

    groups = [{"params": [*noise_models.parameters()]}]
    descend(groups, loss, settings.noise_model_updates, settings.noise_model_rate, on_update)


def noise_models_loss(
    noise_models: NoiseModelParameters,  # that learn
    noise_model: Tensor,  # (B,) that each sequence is of
    variance: Tensor,  # (B,) R of each [deg^2]
    residual: Tensor,  # (B, N) samples in units of sqrt(R), smeared
    doubt: Tensor,  # (B, 1) variance that they are smeared by, in units of R
) -> Tensor:
    """Return the loss of noise models on samples of them."""
    every = noise_models(variance)
    rows = torch.arange(len(noise_model))
    place, log_weight, width = (
        of[rows, noise_model][:, None] for of in (every.place, every.log_weight, every.width)
    )
    off, whole = residual[..., None] - place, width + doubt[..., None]
    log_parts = log_density(log_weight, off, whole)
    likelihood = torch.logsumexp(log_parts, dim=-1)
    # The score of a noise model, as its samples have it: its mean square is their information (Fisher 1925).
    score = (torch.softmax(log_parts, dim=-1) * off / whole).sum(dim=-1).detach()
    scatter = every.effective[rows, noise_model][:, None] + doubt
    information = 0.5 * (score**2 * scatter - torch.log(scatter))
    loss: Tensor = (
        -likelihood.mean() - every.log_prior[rows, noise_model].mean() + _OF_INFORMATION * information.mean()
    )
    return loss
