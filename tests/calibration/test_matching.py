"""A preset is matched to a published Coleman-Hodgdon model."""

import numpy as np
from calibrating import TRUTH
from hypothesis import given
from hypothesis import strategies as st

from twin.calibration.matching import best_coleman_hodgdon, match, training_commands
from twin.calibration.parameters import FreeParameters
from twin.dataset.episodes import make_episode
from twin.dataset.recipe import EpisodeKey, Recipe
from twin.hysteresis import ColemanHodgdon
from twin.physics import simulate


@given(a=st.floats(0.2, 3), b=st.floats(2, 40), c=st.floats(0, 20), start=st.floats(-20, 20))
def test_model_nearest_to_its_own_records_is_itself(a, b, c, start):
    pull = 3 + np.sin(np.linspace(0, 4 * np.pi, 120)) * np.linspace(1, 0.5, 120)
    found, rmse = best_coleman_hodgdon([(pull, ColemanHodgdon(a, b, c).response(pull, start))])
    np.testing.assert_allclose(found, [a, b, c], rtol=2e-3, atol=2e-2)
    assert rmse < 1e-2


def test_preset_is_matched_to_given_coleman_hodgdon_parameters():
    commands = [3e-3 + 1e-3 * np.sin(2 * np.pi * np.arange(0, 8, 0.02) / 4.0)]
    told = []
    wanted = TRUTH.replace(section_stiffness=0.03, sheath_friction_floor=0.7)
    episode = simulate(wanted, commands[0], 0.02)
    target, _ = best_coleman_hodgdon([(episode.pull_mm[::5], episode.bend_deg[::5])])
    free = FreeParameters(TRUTH, ("section_stiffness", "sheath_friction_floor", "pretension"))
    preset = match(free, target, commands, on_iteration=lambda *news: told.append(news))
    reached = simulate(preset, commands[0], 0.02)
    found, _ = best_coleman_hodgdon([(reached.pull_mm[::5], reached.bend_deg[::5])])
    before = np.abs(np.log(told[0][1] / target)).max()
    assert np.abs(np.log(found / target)).max() < min(0.01, before / 5)


def test_commands_of_the_match_are_those_of_generate(tmp_path):
    recipe = Recipe(TRUTH, ((2.0, 4.0),), seconds=3.0, seeds=(7,))
    for number, pull in enumerate(training_commands((2e-3, 4e-3), 2, 3.0, 7)):
        assert np.array_equal(make_episode(recipe, EpisodeKey(7, number)).pull, pull)
