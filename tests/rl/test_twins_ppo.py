"""PPO on the policy of RAM (twins): its environment is the filter, and what it learns is the policy alone."""

import csv

import numpy as np
import pytest
import torch
from small_twins import TINY, shorter, small_source, small_step, twins

from rl.on_twins import train_ram_twins
from rl.options import TrainingOptions
from rl.trainers import Material, Simulated, find_trainer
from rl.twins.filter_step import ALL
from rl.twins.learning import SMALLEST_ERROR_DEG2, TypicalErrors, departure, filter_sequences, validation
from rl.twins.ppo import TwinsEnvironment, learn_by_ppo
from rl.twins.settings import PPO_HORIZON
from twin.estimation.learned.trained_file import read_trained_file

COUNT = 8


def ignore(*told):
    pass


def environment(step, count=COUNT, settings=TINY):
    return TwinsEnvironment(step, small_source(), settings, count, scale=0.5)


def test_a_sequence_of_actions_is_the_filter_that_takes_them():
    step = small_step(loud=0.1)
    outside = environment(step)
    seen = outside.reset()
    drawn = outside.drawn
    expected = []
    for sample, (output, _) in enumerate(filter_sequences(step, drawn, ALL)):
        np.testing.assert_allclose(seen, output.seen.detach(), atol=1e-4)
        if sample % TINY.window == 0:  # before this window is met
            means, met = (np.copy(of) for of in (outside.typical.means, outside.typical.met))
            own = TypicalErrors(TINY)
            own.means, own.met = means, met
            factors = own.factors(drawn, sample // TINY.window)
            assert torch.isfinite(factors).all()
        square = (output.bend_deg - drawn.truth_deg[sample]) ** 2 + SMALLEST_ERROR_DEG2
        lost = factors * square + TINY.linear_penalty * departure(output.action, drawn.linear)
        with torch.no_grad():
            seen, reward, ended, infos = outside.step(step.policy(torch.as_tensor(seen)).numpy())
        np.testing.assert_allclose(reward, -0.5 * lost.detach(), rtol=1e-3)
        expected.append(-lost.detach().numpy())
        assert ended.all() == (sample == TINY.episode - 1)
    total = np.sum(expected, axis=0)
    np.testing.assert_allclose([info["episode"]["r"] for info in infos], total, rtol=1e-3)
    np.testing.assert_allclose(infos[0]["terminal_observation"], output.seen[0].detach(), atol=1e-4)


def test_rewards_of_all_families_are_alike_from_the_start():
    outside = environment(small_step(), 256, shorter(sequences=512))
    outside.reset()
    family = outside.drawn.family.numpy()
    lost = -sum(outside.step(np.zeros((256, 4)))[1] for _ in range(TINY.episode)) / 0.5 / TINY.episode
    means = [lost[family == one].mean() for one in np.unique(family)]
    assert min(means) > 0.2
    assert max(means) < 5


def test_it_learns_the_policy_alone_and_hands_over_its_weights():
    step = small_step()
    before = {name: values.clone() for name, values in step.state_dict().items()}
    told = []
    learn_by_ppo(step, small_source(), shorter(gain=("ppo",), ppo_samples=51_200), ignore, told.append)
    after = step.state_dict()
    changed = {name.split(".")[0] for name in before if not torch.equal(before[name], after[name])}
    assert changed == {"policy"}
    assert told == sorted(told)
    assert told[-1] == 51_200


def test_it_unlearns_a_policy_that_trusts_nothing():
    step = small_step()
    with torch.no_grad():
        step.policy[-1].bias[0] = -0.5  # tanh(-0.5) * 5: a gain of a tenth of what is best
    settings = shorter(gain=("ppo",), ppo_samples=76_800, sequences=64)
    before = validation(step, small_source(), settings).loss
    learn_by_ppo(step, small_source(), settings, ignore, ignore)
    assert validation(step, small_source(), settings).loss < before - 0.03


@pytest.mark.parametrize("gain", [("ppo",), ("analytic", "ppo")])
def test_a_training_keeps_what_was_best_on_held_out_twins(gain, tmp_path):
    told = []
    path = train_ram_twins(
        *twins(), shorter(gain=gain, ppo_samples=PPO_HORIZON), tmp_path, lambda *of: told.append(of[:2])
    )
    assert read_trained_file(path).description["training"]["gain"] == list(gain)
    rows = list(csv.DictReader((tmp_path / "progress.csv").open()))
    samples = [int(row["samples"]) for row in rows]
    assert samples == sorted(samples)
    analytic = TINY.updates * TINY.sequences * TINY.window if "analytic" in gain else 0
    assert samples[-1] == analytic + PPO_HORIZON
    assert told == sorted(told)
    assert told[-1] == (1000, 1000)


def test_families_that_were_never_met_count_as_others_do():
    """With sixteen sequences of eight families, a sample time may miss one."""
    for seed in range(4):
        settings = shorter(seed=seed)
        outside = environment(small_step(), 64, settings)
        for _ in range(3):
            outside.reset()
            assert torch.isfinite(outside.factors).all()


def test_a_policy_that_became_worse_is_not_what_is_kept(tmp_path, monkeypatch):
    def spoil(step, source, settings, on_share, on_weights):
        with torch.no_grad():
            step.policy[-1].bias[0] = -3.0
        on_weights(settings.ppo_samples)

    kept = []
    monkeypatch.setattr("rl.twins.ppo.learn_by_ppo", spoil)
    monkeypatch.setattr(
        "rl.on_twins.export_twins", lambda step, *_: kept.append(step.policy[-1].bias[0].item())
    )
    train_ram_twins(*twins(), shorter(gain=("analytic", "ppo")), tmp_path)
    assert kept[0] > -1


def test_weights_that_are_no_numbers_are_told_as_divergence():
    step = small_step()
    with torch.no_grad():
        step.policy[-1].bias[1] = torch.nan
    with pytest.raises(FloatingPointError, match="the training has diverged"):
        learn_by_ppo(step, small_source(), shorter(gain=("ppo",), ppo_samples=25_600), ignore, ignore)


def test_the_same_seed_gives_the_same_policy():
    weights = []
    for _ in range(2):
        step = small_step()
        learn_by_ppo(step, small_source(), shorter(gain=("ppo",), ppo_samples=25_600), ignore, ignore)
        weights.append(step.policy[-1].weight.detach().clone())
    torch.testing.assert_close(*weights, rtol=0, atol=0)


@pytest.mark.parametrize(
    ("agent", "gain", "match"),
    [
        ("ram-twins", ("ppo", "analytic"), "gain ppo analytic: valid are analytic; ppo; analytic ppo"),
        ("ram-twins", ("sac",), "gain sac: valid are"),
        ("ram-memory", ("ppo",), "gain ppo: valid are analytic$"),
    ],
)
def test_a_way_of_learning_that_there_is_not_is_refused(agent, gain, match, tmp_path):
    material = Material(simulated=Simulated(*twins(), gain=gain))
    with pytest.raises(ValueError, match=match):
        find_trainer(agent).run(material, TrainingOptions(agent=agent, episodes=1), tmp_path)
    assert not list(tmp_path.iterdir())
