"""PPO on the policy of RAM (twins): its environment is the filter, and what it learns is the policy alone."""

import csv

import briefly
import numpy as np
import pytest
import torch
from small_twins import TINY, shorter, small_source, small_step, twins

from rl.on_twins import train_ram_twins
from rl.twins.filter_step import ALL
from rl.twins.learning import SMALLEST_ERROR_DEG2, TypicalErrors, departure, filter_sequences
from rl.twins.ppo import TwinsEnvironment, learn_by_ppo
from rl.twins.settings import PPO_HORIZON
from twin.estimation.learned.trained_file import read_trained_file

COUNT = 8


def ignore(*reported):
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


def test_it_learns_the_policy_alone_and_hands_over_its_weights():
    step = small_step()
    before = {name: values.clone() for name, values in step.state_dict().items()}
    reported = []
    learn_by_ppo(step, small_source(), shorter(gain=("ppo",), ppo_samples=51_200), ignore, reported.append)
    after = step.state_dict()
    changed = {name.split(".")[0] for name in before if not torch.equal(before[name], after[name])}
    assert changed == {"policy"}
    assert reported == sorted(reported)
    assert reported[-1] == 51_200


@pytest.mark.slow
@pytest.mark.parametrize("gain", [("ppo",), ("analytic", "ppo")])
def test_a_training_keeps_what_was_best_on_held_out_twins(gain, tmp_path, monkeypatch):
    briefly.choose_members(monkeypatch)
    reported = []
    path = train_ram_twins(
        *twins(), shorter(gain=gain, ppo_samples=PPO_HORIZON), tmp_path, lambda *of: reported.append(of[:2])
    )
    assert read_trained_file(path).description["training"]["gain"] == list(gain)
    rows = list(csv.DictReader((tmp_path / "progress.csv").open()))
    samples = [int(row["samples"]) for row in rows]
    assert samples == sorted(samples)
    analytic = TINY.updates * TINY.sequences * TINY.window if "analytic" in gain else 0
    assert samples[-1] == analytic + PPO_HORIZON
    assert reported == sorted(reported)
    assert reported[-1] == (1000, 1000)


def test_weights_that_are_no_numbers_are_reported_as_divergence():
    step = small_step()
    with torch.no_grad():
        step.policy[-1].bias[1] = torch.nan
    with pytest.raises(FloatingPointError, match="the training has diverged"):
        learn_by_ppo(step, small_source(), shorter(gain=("ppo",), ppo_samples=25_600), ignore, ignore)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_policy():
    weights = []
    for _ in range(2):
        step = small_step()
        learn_by_ppo(step, small_source(), shorter(gain=("ppo",), ppo_samples=25_600), ignore, ignore)
        weights.append(step.policy[-1].weight.detach().clone())
    torch.testing.assert_close(*weights, rtol=0, atol=0)
