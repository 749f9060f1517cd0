"""The lesson of the laws: each learns the density of its noise, from samples of that noise alone.

No filter is needed for it. Samples are smeared as the belief of a filter would smear them, by any amount.
"""

import math

import torch

from rl.twins.laws import Laws, log_density
from rl.twins.learning import OnUpdate, descend
from rl.twins.noises import draw_noises
from rl.twins.settings import TwinsTraining
from twin.signals.streams import SeedUse, random_stream

Tensor = torch.Tensor

BATCH, SAMPLES = 512, 24  # sequences of one update, and samples of each
_LENGTH = 96  # of a sequence that they are taken from
_DOUBT = (0.01, 0.55)  # variance of the belief that smears a sample, in units of R
_OF_MEAN, _OF_INFORMATION = 3.0, 0.3  # weights of the losses beside the likelihood


def learn_laws(laws: Laws, settings: TwinsTraining, on_update: OnUpdate | None = None) -> None:
    """Learn densities by maximum likelihood, how often each law is met, and how much its samples tell."""
    rng = random_stream(settings.seed, SeedUse.LESSON_LAWS)
    noise = draw_noises(settings.known_noises, settings.laws_sequences, _LENGTH, rng)
    variance, law = torch.as_tensor(noise.variance).float(), torch.as_tensor(noise.law)
    residual = torch.as_tensor(noise.noise_deg).float() / torch.sqrt(variance)[:, None]
    mean = torch.as_tensor(noise.mean_deg).float() / torch.sqrt(variance)
    least, most = map(math.log, _DOUBT)

    def loss(update: int) -> Tensor:
        rows = torch.as_tensor(rng.integers(len(law), size=BATCH))
        chosen = torch.as_tensor(rng.integers(_LENGTH, size=SAMPLES))
        doubt = torch.exp(torch.as_tensor(rng.uniform(least, most, (BATCH, 1))).float())
        smeared = torch.as_tensor(rng.standard_normal((BATCH, SAMPLES))).float() * torch.sqrt(doubt)
        return laws_loss(
            laws, law[rows], variance[rows], mean[rows], residual[rows][:, chosen] + smeared, doubt
        )

    groups = [{"params": [*laws.parameters()]}]
    descend(groups, loss, settings.laws_updates, settings.laws_rate, on_update)


def laws_loss(
    laws: Laws, law: Tensor, variance: Tensor, mean: Tensor, residual: Tensor, doubt: Tensor
) -> Tensor:
    """Return the loss of laws on samples of them.

    Args:
        laws: that learn.
        law: (B,) that each sequence is of.
        variance: (B,) R of each [deg^2].
        mean: (B,) of its noise in units of sqrt(R).
        residual: (B, N) samples in units of sqrt(R), smeared.
        doubt: (B, 1) variance that they are smeared by, in units of R.
    """
    every = laws(variance)
    rows = torch.arange(len(law))
    place, log_weight, width = (of[rows, law][:, None] for of in (every.place, every.log_weight, every.width))
    off, whole = residual[..., None] - place, width + doubt[..., None]
    log_parts = log_density(log_weight, off, whole)
    likelihood = torch.logsumexp(log_parts, dim=-1)
    # The score of a law, as its samples have it: its mean square is their information (Fisher 1925).
    score = (torch.softmax(log_parts, dim=-1) * off / whole).sum(dim=-1).detach()
    scatter = every.effective[rows, law][:, None] + doubt
    information = 0.5 * (score**2 * scatter - torch.log(scatter))
    off_mean = (every.mean[rows, law] - mean) ** 2
    loss: Tensor = (
        -likelihood.mean()
        - every.log_prior[rows, law].mean()
        + _OF_INFORMATION * information.mean()
        + _OF_MEAN * off_mean.mean()
    )
    return loss
