"""Members of RAM (twins): spread evenly, and chosen so that their ensemble makes other endoscopes likely."""

import numpy as np
import pytest
from scipy import stats
from small_twins import TINY, generator, twins

from rl.twins.members import UNEXPLAINED_DEG, choose_members, draw_members, ensemble_unlikelihood
from twin.reduced import simulate_batch
from twin.signals.excitation import SIGNALS, command


def test_members_lie_evenly_over_every_range_and_differ_by_seed():
    """A Latin hypercube: of M members, each Mth of a range holds one. Of moving sheaths, courses do so."""
    preset, ranges = twins()
    members = draw_members(preset, ranges, 16, 3, moving=8)
    for name, low, high in ranges.limits:
        values = np.array([getattr(member, name) for member in members.presets])
        share = (
            np.log(values / low) / np.log(high / low) if 0 < 2 * low < high else (values - low) / (high - low)
        )
        assert sorted(np.floor(share * 16)) == list(range(16))
    low, high = {name: limits for name, *limits in ranges.limits}["sheath_bend"]
    shares = (
        (members.other[8:] - low) / (high - low),
        members.phase[8:],
        np.log(members.period[8:] / 80) / np.log(3),
    )
    for share in shares:
        assert sorted(np.floor(share * 8)) == list(range(8))
    assert (members.other != [member.sheath_bend for member in members.presets]).tolist() == [False] * 8 + [
        True
    ] * 8
    assert draw_members(preset, ranges, 16, 3, moving=8).presets == members.presets
    assert not set(draw_members(preset, ranges, 16, 4, moving=8).presets) & set(members.presets)
    assert not draw_members(preset, ranges, 6, TINY.seed).moves


def test_unlikelihood_is_that_of_a_normal_law_with_the_members_moments():
    rng = generator(4)
    members, others = rng.normal(1.0, 3.0, (9, 5)), rng.normal(0.0, 4.0, (30, 5))
    noise_model = stats.multivariate_normal(
        members.mean(axis=0), np.cov(members, rowvar=False) + UNEXPLAINED_DEG**2 * np.eye(5)
    )
    expected = -2 * noise_model.logpdf(others).mean() - 5 * np.log(2 * np.pi)
    assert ensemble_unlikelihood(members, others) == pytest.approx(expected)


@pytest.mark.slow
def test_chosen_members_explain_endoscopes_that_members_spread_evenly_do_not():
    """Others than they were chosen from, along other commands; compared is what is left of the worst one."""
    preset, ranges = twins()
    rng = generator(11)
    pulls = [command(kind, (-4e-3, 4e-3), 20.0, 0.1, rng) for kind in SIGNALS]

    def angles(presets):
        runs = [(one, pull) for one in presets for pull in pulls]
        episodes = simulate_batch([one for one, _ in runs], [pull for _, pull in runs], 0.1)
        return np.array([episode.truth_deg[::10] for episode in episodes]).reshape(len(presets), -1)

    def largest_rest(presets, others):
        """Return the RMS of the rest [deg] of the other that a normal ensemble explains least."""
        members = angles(presets)
        covariance = np.cov(members, rowvar=False)
        inflated = covariance + UNEXPLAINED_DEG**2 * np.eye(len(covariance))
        off = (others - members.mean(axis=0)).T
        rest = off - covariance @ np.linalg.solve(inflated, off)
        return np.sqrt(np.mean(rest**2, axis=0)).max()

    others = angles([ranges.draw(preset, rng) for _ in range(60)])
    for seed in (1, 2):
        chosen, spread = (of(preset, ranges, 12, seed).presets for of in (choose_members, draw_members))
        assert largest_rest(chosen, others) < 0.75 * largest_rest(spread, others)
