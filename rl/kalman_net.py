"""The active model with a learned gain, after KalmanNet (Revach et al. 2022, arXiv 2107.10043).

The state is that of the active model, X = [theta, f]: the bending angle [deg] and the error of the model
[deg / s]. The prediction is also that of the active model, theta_k|k-1 = step(theta_{k-1}) + f T. The
correction K (y_k - theta_k|k-1) has its gain from a small recurrent network in place of P, Q and R. It sees
the paper's four features, F1 the difference of successive measurements, F2 the innovation, F3 the difference
of successive estimates and F4 the latest correction, in units of the given sqrt(R). From F1 and F3 the
model's prediction is subtracted: a pull that moves the angle is then no surprise, and errors that grow
together with sqrt(R) are filtered alike. For f, F3 and F4 are the same.

The gains are bounded: K_theta in [0, 1], a convex step towards the measurement, and K_f in [0, 2] per second.
Without a measurement the filter predicts, and the network stays as it is. It learns by back-propagation
through the filter, cut at the end of every window; bounded gains, clipped gradients and the cut guard against
losses of NaN.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rl.options import TrainingOptions
from rl.policies import log_scale
from rl.supervised import Lesson, SequenceTraining, tensor32, train_network
from rl.trainers import OnProgress, Records, Trainer, register_trainer
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask
from twin.estimation.learned.methods import KALMAN_NET
from twin.estimation.learned.step import LEAST_VARIANCE, affine_steps, check_affine
from twin.signals.streams import SeedUse, random_stream

Array = NDArray[np.float64]
Tensor = torch.Tensor
FEATURES = 5  # that the gain sees
ERROR_GAIN_LIMIT = 2.0  # largest gain of f [1 / s]
FIRST_GAIN = (0.3, 0.1)  # of theta and, in parts of its limit, of f: where training begins
EPISODE = 300  # samples until all filters start again, from another wrong initial estimate
SETTINGS = SequenceTraining(iterations=1500, window=50, hidden=16, learning_rate=3e-3)


class KalmanNetStep(torch.nn.Module):
    """One sample: prediction, gain from one GRU layer and a linear output, and correction."""

    inputs = ("keep", "drive_deg", "measurement_deg", "variance", "sample_time")

    def __init__(self, hidden: int):
        super().__init__()
        numbers = ("previous_deg", "error", "lag_deg", "of_bend", "of_error")  # of the state of one filter
        self.state: dict[str, tuple[int, ...]] = {name: () for name in numbers} | {"hidden": (hidden,)}
        self.cell = torch.nn.GRUCell(FEATURES, hidden)
        self.output = torch.nn.Linear(hidden, 2)
        self.limits = torch.nn.Buffer(torch.tensor([1.0, ERROR_GAIN_LIMIT]))
        with torch.no_grad():
            self.output.bias.copy_(torch.logit(torch.tensor(FIRST_GAIN)))

    def start(self, bend_deg: Tensor) -> tuple[Tensor, ...]:
        """Return the state of filters at their (B,) initial estimates [deg]."""
        zero = torch.zeros_like(bend_deg)
        return bend_deg, zero, zero, zero, zero, bend_deg.new_zeros(len(bend_deg), *self.state["hidden"])

    def forward(
        self,
        keep: Tensor,
        drive_deg: Tensor,
        measurement_deg: Tensor,
        variance: Tensor,
        sample_time: Tensor,
        previous_deg: Tensor,
        error: Tensor,
        lag_deg: Tensor,
        of_bend: Tensor,
        of_error: Tensor,
        hidden: Tensor,
    ) -> tuple[Tensor, ...]:
        """Return the state one sample later, the estimate first.

        All are (B,), but `hidden` (B, units). `lag_deg` is the last measurement less the estimate, `of_bend`
        and `of_error` are the latest correction [deg], [deg / s].
        """
        prediction = keep * previous_deg + drive_deg + error * sample_time
        missing = torch.isnan(measurement_deg)
        measurement = torch.where(missing, prediction, measurement_deg)
        innovation = measurement - prediction
        difference = measurement - keep * (previous_deg + lag_deg) - drive_deg  # F1
        moved = (error - of_error) * sample_time + of_bend  # F3
        seen = [difference, innovation, moved, of_bend, of_error * sample_time]
        # On a logarithmic scale: a wrong initial estimate is sixty units of sqrt(R), and the noise one.
        after = self.cell(log_scale(torch.stack(seen, dim=1) / torch.sqrt(variance)[:, None]), hidden)
        gain = self.limits * torch.sigmoid(self.output(after))
        correction = gain * innovation[:, None]
        bend = prediction + correction[:, 0]
        after = torch.where(missing[:, None], hidden, after)
        return bend, error + correction[:, 1], measurement - bend, correction[:, 0], correction[:, 1], after


def train_kalman_net(
    records: Records,
    active_model: ActiveModel,
    training: SequenceTraining,
    folder: Path,
    on_progress: OnProgress | None = None,
) -> Path:
    """Train into a folder and return the file; the active model gives model, sample time and R."""
    check_affine(active_model.model)

    def prepare(task: TrainingTask) -> Lesson:
        step = KalmanNetStep(training.hidden)
        losses = window_losses(step, task, active_model, training)
        samples = training.sequences * min(training.window, task.pull_mm.shape[1] - 1)
        unit = float(np.maximum(active_model.measurement_variance, LEAST_VARIANCE))
        return Lesson(step, lambda: next(losses), samples, unit, lambda: step)

    return train_network(KALMAN_NET, prepare, records, active_model, training, folder, on_progress)


def window_losses(
    step: KalmanNetStep, task: TrainingTask, active_model: ActiveModel, training: SequenceTraining
) -> Iterator[Tensor]:
    """Yield the mean square error, in units of R, of one window after another, with its gradient."""
    rng = random_stream(training.seed, SeedUse.NETWORK)
    keep_all, drive_all = affine_steps(active_model.model, task.pull_mm)
    episode = min(EPISODE, task.pull_mm.shape[1] - 1)
    window = min(training.window, episode)
    R = tensor32(np.full(training.sequences, np.maximum(active_model.measurement_variance, LEAST_VARIANCE)))
    T = torch.full_like(R, active_model.sample_time)

    while True:
        # All filters start again, anywhere in the records, from initial estimates that are wrong.
        record, measured, initial = task.draw(training.sequences, rng)
        truth = task.bend_deg[record]
        start = rng.integers(truth.shape[1] - episode, size=len(record))
        rows, index = np.arange(len(record)), start + np.arange(1, episode + 1)[:, None]
        series = (keep_all[record], drive_all[record], measured, truth)
        samples = torch.stack([tensor32(values[rows, index]) for values in series], dim=1)  # (N, 4, B)
        state = step.start(tensor32(truth[rows, start] + initial - truth[:, 0]))

        for begins in range(0, episode - window + 1, window):
            # The state is passed on to the next window, its history is not.
            state = tuple(value.detach() for value in state)
            estimate = []
            for keep, drive, measurement, _ in samples[begins : begins + window]:
                state = step(keep, drive, measurement, R, T, *state)
                estimate.append(state[0])
            error = torch.stack(estimate) - samples[begins : begins + window, 3]
            yield (error**2 / R).mean()


def _train(records: Records, active_model: ActiveModel, options: TrainingOptions, *rest: Any) -> Path:
    return train_kalman_net(records, active_model, SETTINGS.scaled(options), *rest)


register_trainer(Trainer(KALMAN_NET, _train))
