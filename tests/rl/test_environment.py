import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as check_gymnasium
from stable_baselines3.common.env_checker import check_env as check_stable_baselines

from rl.environment import BatchEnvironment, EstimationEnvironment
from rl.registration import ENVIRONMENT_ID, TWINS_ID
from twin.estimation.active_model import ActiveModel
from twin.estimation.knowledge import TrainingTask, stack_records


@pytest.fixture
def task(records):
    return TrainingTask(*stack_records(records))


def batch(task, model, count, seed=0):
    return BatchEnvironment(task, ActiveModel(model, 0.1), count, seed)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        (ENVIRONMENT_ID, {"agent": "ram", "render_mode": "rgb_array"}),
        (ENVIRONMENT_ID, {"agent": "direct"}),
        (TWINS_ID, {"twins": 4, "seconds": 4.0}),
    ],
)
def test_registered_environment_passes_both_checkers(name, options):
    environment = gymnasium.make(name, **options)
    check_gymnasium(environment.unwrapped, skip_render_check="render_mode" not in options)
    check_stable_baselines(environment.unwrapped)


def test_a_vector_of_environments_is_the_batch_and_one_that_ends_begins_again(records, model):
    vector = gymnasium.make_vec(ENVIRONMENT_ID, 3, records=records, model=model)
    many = batch(TrainingTask(*stack_records(records)), model, 3)
    many.seed(5)
    np.testing.assert_array_equal(vector.reset(seed=5)[0], many.reset())
    ended = 0
    for _ in range(len(records[0][0])):
        action = vector.action_space.sample()
        seen, reward, _, truncated, info = vector.step(action)
        expected = many.step(action)
        np.testing.assert_array_equal(seen, expected[0])
        np.testing.assert_array_equal(reward.astype(np.float32), expected[1])
        for place in np.flatnonzero(truncated):
            ended += 1
            np.testing.assert_array_equal(
                info["final_obs"][place], expected[3][place]["terminal_observation"]
            )
    assert ended >= 3


def test_infos_and_pictures_show_the_episode(records, model):
    environment = EstimationEnvironment(records, model, render_mode="rgb_array")
    _, info = environment.reset(seed=1)
    assert abs(info["estimate_deg"] - info["truth_deg"]) <= 20
    before = environment.render()
    _, reward, _, _, info = environment.step(np.zeros(2, np.float32))
    assert reward == pytest.approx(-((info["estimate_deg"] - info["truth_deg"]) ** 2), rel=1e-5)
    assert environment.render().shape == before.shape == (400, 600, 3)
    assert (environment.render() != before).any()


def test_single_environment_is_the_batch_of_one(records, model):
    single = EstimationEnvironment(records, model)
    many = batch(TrainingTask(*stack_records(records)), model, 1)
    many.seed(5)
    observation, _ = single.reset(seed=5)
    np.testing.assert_array_equal(observation, many.reset()[0])
    rng = np.random.default_rng(0)
    for _ in range(50):
        action = rng.uniform(-1, 1, 2).astype(np.float32)
        one = single.step(action)
        observations, rewards, _, _ = many.step(action[None])
        np.testing.assert_array_equal(one[0], observations[0])
        assert one[1] == rewards[0]


def test_reward_is_minus_the_squared_error_of_the_estimate(task, model):
    environment = batch(task, model, 6)
    environment.reset()
    truth = task.bend_deg[environment.record, environment.sample]
    observed = environment._observed
    estimate = (observed.bend_deg + 0.5 * observed.phi).numpy()
    _, reward, _, _ = environment.step(np.tile([0.0, -1.0], (6, 1)))
    np.testing.assert_allclose(reward, -((estimate - truth) ** 2), rtol=1e-6)


def test_an_episode_is_truncated_at_the_end_of_its_record_and_the_next_begins(task, model):
    environment = batch(task, model, 1)
    environment.reset()
    samples = task.pull_mm.shape[1]
    total = 0.0
    for k in range(1, samples):
        observation, reward, done, infos = environment.step(np.zeros((1, 2)))
        total += reward[0]
        assert done[0] == (k == samples - 1)
    assert infos[0]["TimeLimit.truncated"]
    assert infos[0]["episode"]["r"] == pytest.approx(total, rel=1e-5)
    assert infos[0]["episode"]["l"] == samples - 1
    assert not np.array_equal(observation[0], infos[0]["terminal_observation"])
    assert environment.sample[0] == 1


@pytest.mark.parametrize("agent", ["ram", "direct"])
def test_every_stretch_of_samples_holds_starts_in_their_true_proportion(task, model, agent):
    """An update of PPO takes so many steps of each environment; every episode after the first is complete."""
    count, steps = 16, 25
    environment = BatchEnvironment(task, ActiveModel(model, 0.1), count, seed=0, agent=agent)
    complete = task.pull_mm.shape[1] - 1
    environment.reset()
    assert len(set(environment.first)) == count
    lengths, finished = [[] for _ in range(count)], []
    for _ in range(4 * complete // steps):
        finished.append(0)
        for _ in range(steps):
            _, _, done, infos = environment.step(np.zeros((count, environment.filter_step.actions)))
            finished[-1] += done.sum()
            for place in np.flatnonzero(done):
                lengths[place].append(infos[place]["episode"]["l"])
    expected = steps * count / complete
    assert np.abs(np.array(finished) - expected).max() < 1
    assert all(set(of[1:]) == {complete} for of in lengths)


def test_observation_holds_measured_residuals_and_never_the_truth(records, model):
    """The same measurements under another truth give the same observations: only the reward knows it."""
    task = TrainingTask(*stack_records(records))
    environment = batch(task, model, 5)
    environment.reset()
    shifted = batch(TrainingTask(task.pull_mm, task.bend_deg + 3.0), model, 5)
    shifted.reset()
    shifted.record, shifted.measurement = environment.record, environment.measurement
    shifted.state, shifted._observed = environment.state, environment._observed
    for _ in range(10):
        one = environment.step(np.zeros((5, 2)))
        two = shifted.step(np.zeros((5, 2)))
        np.testing.assert_array_equal(one[0], two[0])
        assert not np.array_equal(one[1], two[1])
