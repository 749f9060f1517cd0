"""The estimation task as environments: one for Gymnasium, and one batched over many episodes for training."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from rl.policies import POLICY_STEPS, PolicyStep, RamStep
from twin.errors import InputError
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records
from twin.estimation.learned.step import affine_steps
from twin.hysteresis import ColemanHodgdon, HysteresisModel

Array = NDArray[np.float64]
Array32 = NDArray[np.float32]
StepResult = tuple[Array32, Array32, NDArray[np.bool_], list[dict[str, Any]]]
TWINS_OF_COMMAND = 4  # of EstimationTwins-v0
_OBSERVATION_LIMIT = 10.0  # exp(10) degrees: never reached, it only bounds the space


class SharedEnvironment(VecEnv):
    """Many episodes side by side for stable-baselines3, with one source of random numbers `rng`."""

    rng: np.random.Generator
    episode_return: Array

    def __init__(self, count: int, observations: gymnasium.spaces.Box, actions: gymnasium.spaces.Box):
        self.render_mode = None  # read by the next line
        super().__init__(count, observations, actions)

    def step_async(self, actions: Array32) -> None:
        """Take (count, action_size) actions."""
        self.actions = np.asarray(actions, dtype=float)

    def _infos(
        self, ended: NDArray[np.bool_], seen: Array32, length: NDArray[np.int64]
    ) -> list[dict[str, Any]]:
        """Return the infos of a step: the (count,) episodes that end are truncated.

        `seen` are the (count, observation_size) last observations, `length` the (count,) samples so far.
        """
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for place in np.flatnonzero(ended):
            infos[place] = {
                "TimeLimit.truncated": True,
                "terminal_observation": seen[place],
                "episode": {"r": float(self.episode_return[place]), "l": int(length[place]), "t": 0.0},
            }
        return infos

    def close(self) -> None:
        """Nothing to release."""

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Restart the random numbers of all environments."""
        self.rng = np.random.default_rng(seed)
        return [seed] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute, which all environments share."""
        return [getattr(self, attr_name)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute, which all environments share."""
        setattr(self, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method once and return its result for every environment."""
        return [getattr(self, method_name)(*args, **kwargs)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """No environment is wrapped."""
        return [False] * self.num_envs


class BatchEnvironment(SharedEnvironment):
    """Many episodes side by side for stable-baselines3: a step is arithmetic on arrays.

    The reward is eq. 11, minus the squared error of the estimate [deg^2], times `reward_scale`. An episode
    ends, truncated, with its record; its environment then draws the next one.

    The first episodes begin evenly spread over their records, each from a wrong initial estimate, as at any
    start. So episodes end and begin one after the other, and every update of a policy contains starts in
    their true proportion: without them it forgets how to correct a wrong initial estimate.

    Attributes:
        record: (count,) record of each episode.
        first: (count,) sample at which it began.
        sample: (count,) next sample of each.
        measurement: (count, N) measured angles of the episodes [deg].
        state: of the estimators, (count,) tensors by name.
        estimate_deg: (count,) estimates after the latest step, of episodes that it ended too [deg].
    """

    def __init__(
        self,
        task: TrainingTask,
        active_model: ActiveModel,
        count: int,
        seed: int | None = None,
        reward_scale: float = 1.0,
        agent: str = RamStep.agent,
    ):
        self.filter_step: PolicyStep = POLICY_STEPS[agent](active_model)
        limit, sizes = _OBSERVATION_LIMIT, (self.filter_step.observations, self.filter_step.actions)
        super().__init__(
            count,
            gymnasium.spaces.Box(-limit, limit, sizes[:1], np.float32),
            gymnasium.spaces.Box(-1.0, 1.0, sizes[1:], np.float32),
        )
        self.task, self.reward_scale = task, reward_scale
        self._steps = (
            affine_steps(active_model.model, task.pull_mm) if "keep" in self.filter_step.inputs else ()
        )
        constants = {
            "variance": np.broadcast_to(np.asarray(active_model.measurement_variance, dtype=float), count),
            "sample_time": np.full(count, active_model.sample_time),
        }
        self._constants = {name: torch.tensor(values) for name, values in constants.items()}
        self.seed(seed)

    @property
    def bend_deg(self) -> Array:
        """(count,) estimates [deg]."""
        bend: Array = self.state["previous_deg"].numpy()
        return bend

    def reset(self) -> Array32:
        """Begin a new episode in every environment; returns (count, observation_size)."""
        count, steps = self.num_envs, self.task.pull_mm.shape[1] - 1
        self.first = np.arange(count) * steps // count
        self.record, self.measurement, initial = self.task.draw(count, self.rng, self.first)
        self.state = {name: torch.zeros(count, dtype=torch.float64) for name in self.filter_step.state}
        self._start(np.ones(count, dtype=bool), initial)
        self.sample = self.first + 1
        self.episode_return = np.zeros(count)
        return self._observe()

    def _begin_again(self, ended: NDArray[np.bool_]) -> None:
        self.record[ended], self.measurement[ended], initial = self.task.draw(int(ended.sum()), self.rng)
        self._start(ended, initial)
        self.first[ended], self.sample[ended], self.episode_return[ended] = 0, 1, 0.0

    def _start(self, which: NDArray[np.bool_], bend_deg: Array) -> None:
        begun = torch.from_numpy(which)
        for name, values in self.state.items():
            values[begun] = self.filter_step.start.get(name, 0.0)
        self.state["previous_deg"][begun] = torch.from_numpy(bend_deg)

    @torch.no_grad()
    def step_wait(self) -> StepResult:
        """Apply them; returns observations, rewards, ends and infos, new episodes begun where one ended."""
        action = torch.from_numpy(self.actions).clamp(-1, 1)
        after = self.filter_step.act(self._observed, action)
        self.state = dict(zip(self.filter_step.state, after, strict=True))
        self.estimate_deg = self.bend_deg.copy()
        reward = -((self.estimate_deg - self.task.bend_deg[self.record, self.sample]) ** 2)
        self.episode_return += reward
        self.sample += 1
        ended = self.sample == self.task.pull_mm.shape[1]
        infos = self._infos(ended, self._last_observation, self.sample - 1 - self.first)
        if ended.any():
            self._begin_again(ended)
        return self._observe(), (self.reward_scale * reward).astype(np.float32), ended, infos

    @torch.no_grad()
    def _observe(self) -> Array32:
        place = self.record, self.sample
        pull = self.task.pull_mm
        measured = self.measurement[np.arange(self.num_envs), self.sample]
        inputs = {
            "increment_mm": pull[place] - pull[self.record, self.sample - 1],
            "measurement_deg": measured,
            "reference_deg": measured,
        }
        if self._steps:
            inputs["keep"], inputs["drive_deg"] = (values[place] for values in self._steps)
        tensors = {name: torch.from_numpy(values) for name, values in inputs.items()} | self._constants
        self._observed = self.filter_step.observe(tensors, self.state)
        observation: Array32 = self._observed.observation.numpy().astype(np.float32)
        self._last_observation = observation
        return observation


class EstimationEnvironment(gymnasium.Env[Array32, Array32]):
    """One episode at a time, for Gymnasium's tools; the same task and agent as the batched environment.

    `gymnasium.make("EndoTwin/Estimation-v0", records=[(pull_mm, bend_deg), ...], model=...)` after
    `import rl`; without records it makes a short one from the model itself, so that the id works by itself.

    RAM observes phi / sqrt(R) on a symmetric logarithmic scale (1,), and acts by K_RAM of the angle, -1 to 1
    for 0 to 1, and of the model's error, for 0 to 1 per second (2,). Direct RL observes the residual on that
    scale [deg] and the increment of the pull [0.1 mm] (2,), and acts by the change of the angle (1,). The
    reward is minus the square error [deg^2] times `reward_scale`. Infos hold `truth_deg`, `measured_deg` (NaN
    where nothing was measured) and `estimate_deg`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012  Gymnasium's own name

    def __init__(
        self,
        records: Sequence[tuple[Array, Array]] | None = None,
        model: HysteresisModel | None = None,
        *,
        batch: BatchEnvironment | None = None,
        render_mode: str | None = None,
        **options: Any,
    ):
        """Take records at T and the model that the filter predicts by, or a batch of one.

        Options are those of `make_batch`.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(f"unknown render_mode {render_mode!r:.40}; valid: None, rgb_array")
        self.batch = batch or make_batch(1, records, model, **options)
        self.observation_space = self.batch.observation_space
        self.action_space = self.batch.action_space
        self.render_mode = render_mode
        self.course: list[dict[str, float]] = []  # of the episode, where it is drawn

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array32, dict[str, Any]]:
        """Draw a record, its noise and the error of the initial estimate."""
        super().reset(seed=seed)
        if seed is not None:
            self.batch.seed(seed)
        observation = self.batch.reset()[0]
        place = self.batch.record[0], 0
        self.course = []
        return observation, self._info(place, float(self.batch.measurement[0, 0]), self.batch.bend_deg)

    def step(self, action: Array32) -> tuple[Array32, float, bool, bool, dict[str, Any]]:
        """Apply one action; `truncated` at the end of the record."""
        place = self.batch.record[0], int(self.batch.sample[0])
        measured = float(self.batch.measurement[0, place[1]])
        observation, reward, done, infos = self.batch.step(np.asarray(action)[None])
        ended = bool(done[0])
        seen: Array32 = infos[0]["terminal_observation"] if ended else np.asarray(observation)[0]
        return seen, float(reward[0]), False, ended, self._info(place, measured, self.batch.estimate_deg)

    def _info(self, place: tuple[int, int], measured: float, estimate: Array) -> dict[str, Any]:
        pull, truth = (float(of[place]) for of in (self.batch.task.pull_mm, self.batch.task.bend_deg))
        info = {"truth_deg": truth, "measured_deg": measured, "estimate_deg": float(estimate[0])}
        if self.render_mode is not None:
            self.course.append(info | {"pull_mm": pull})
        return info

    def render(self) -> NDArray[np.uint8] | None:
        """Return the episode so far, angles over the pull, (400, 600, 3); None without a render mode."""
        if self.render_mode is None:
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6, 4), dpi=100, layout="constrained")
        canvas, axes = FigureCanvasAgg(figure), figure.subplots()
        pull = [of["pull_mm"] for of in self.course]
        for name, style in (("measured_deg", "."), ("truth_deg", "-"), ("estimate_deg", "-")):
            axes.plot(pull, [of[name] for of in self.course], style, label=name.removesuffix("_deg"))
        axes.set(xlabel="pull [mm]", ylabel="bend [deg]")
        axes.legend(loc="upper left")
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()


class VectorEstimation(gymnasium.vector.VectorEnv[Array32, Array32, NDArray[Any]]):
    """Many episodes side by side for `gymnasium.make_vec`: the batched environment."""

    metadata = {"autoreset_mode": gymnasium.vector.AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(self, num_envs: int = 1, records: Any = None, model: Any = None, **options: Any):
        """Take what `EstimationEnvironment` does."""
        self.num_envs = num_envs
        self.batch = make_batch(num_envs, records, model, **options)
        self.single_observation_space = self.batch.observation_space
        self.single_action_space = self.batch.action_space
        self.observation_space, self.action_space = (
            gymnasium.vector.utils.batch_space(space, num_envs)
            for space in (self.single_observation_space, self.single_action_space)
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array32, dict[str, Any]]:
        """Begin a new episode in every environment."""
        if seed is not None:
            self.batch.seed(seed)
        return self.batch.reset(), {}

    def step(
        self, actions: Array32
    ) -> tuple[Array32, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Apply (num_envs, action_size) actions; where an episode ends, the next one has begun."""
        self.batch.step_async(actions)
        observation, reward, ended, infos = self.batch.step_wait()
        info: dict[str, Any] = {}
        if ended.any():
            last = observation.copy()
            for place in np.flatnonzero(ended):
                last[place] = infos[place]["terminal_observation"]
            info = {"final_obs": last, "_final_obs": ended}
        return observation, reward.astype(float), np.zeros_like(ended), ended, info


def make_batch(
    count: int,
    records: Sequence[tuple[Array, Array]] | None,
    model: HysteresisModel | None,
    *,
    agent: str = RamStep.agent,
    sample_time: float = 0.1,
    noise: str = "gaussian",
    noise_level: float = 0.1,
    initial_error_deg: float = 20.0,
    reward_scale: float = 1.0,
) -> BatchEnvironment:
    """Return episodes side by side of an agent, `ram` or `direct`, at T = `sample_time` [s]."""
    if agent not in POLICY_STEPS:
        raise InputError(f"unknown agent {agent!r}; valid: {', '.join(POLICY_STEPS)}")
    pull, bend = stack_records(records or [model_record(PAPER_MODEL, sample_time)])
    task = TrainingTask(pull, bend, noise, noise_level, initial_error_deg)
    filtered = ActiveModel(model or PAPER_MODEL, sample_time, measurement_variance=noise_level)
    return BatchEnvironment(task, filtered, count, reward_scale=reward_scale, agent=agent)


class EstimationTwinsEnvironment(EstimationEnvironment):
    """The same task on endoscopes drawn from the ranges of a preset, each along a command of its own.

    `gymnasium.make("EndoTwin/EstimationTwins-v0", preset="vio_com")`: reduced twins are simulated when it is
    made, in seconds, and the filter predicts by the model of the nominal endoscope.
    """

    def __init__(
        self,
        preset: str = "ureteroscope",
        *,
        twins: int = 40,
        seconds: float = 30.0,
        stroke_mm: tuple[float, float] = (-4.0, 4.0),
        sample_time: float = 0.1,
        seed: int = 0,
        **options: Any,
    ):
        """Simulate so many twins for so long [s]; other options are those of `EstimationEnvironment`."""
        from rl.twins.records import SAMPLE_TIME, simulate_records
        from rl.twins.run import nominal_model
        from twin.preset import load_preset, load_ranges
        from twin.reduced.members import NO_MEMBERS

        every = round(sample_time / SAMPLE_TIME)
        if every < 1 or abs(every * SAMPLE_TIME - sample_time) > 1e-9:
            raise InputError(f"sample_time = {sample_time:g} s: must be a multiple of {SAMPLE_TIME:g} s")
        endoscope = load_preset(preset)
        pull, _, bend = simulate_records(
            endoscope,
            load_ranges(preset),
            NO_MEMBERS,
            commands=-(-twins // TWINS_OF_COMMAND),
            twins=TWINS_OF_COMMAND,
            seconds=seconds,
            stroke_mm=stroke_mm,
            seed=seed,
        )
        records = [
            (along[::every].astype(float), angle[::every].astype(float))
            for along, angles in zip(pull, bend, strict=True)
            for angle in angles
        ]
        super().__init__(records, nominal_model(endoscope, seed), sample_time=sample_time, **options)


PAPER_MODEL = ColemanHodgdon(1.15, 22.38, 5.0)  # eq. 12


def model_record(model: ColemanHodgdon, sample_time: float) -> tuple[Array, Array]:
    """One minute of the model's own loop on the paper's training stroke."""
    pull = 3 + np.sin(2 * np.pi * np.arange(round(60 / sample_time)) * sample_time / 8)
    return pull, model.response(pull, 60.0)
