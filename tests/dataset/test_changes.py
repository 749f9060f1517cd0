"""Changing a recipe, and counting the conditions that its episodes meet."""

import pytest
from small_dataset import changed

from twin.dataset.recipe_file import change_recipe


def test_a_change_goes_before_the_file_and_leaves_the_rest():
    values = {"seconds": 60, "set": {"pretension": 3, "vertebrae": 6}, "seeds": [1, 2]}
    changes = {"seconds": 10, "set": {"pretension": 4}, "sensor": {"variance_deg2": 2}}
    assert change_recipe(values, changes) == {
        "seconds": 10,
        "set": {"pretension": 4, "vertebrae": 6},
        "seeds": [1, 2],
        "sensor": {"variance_deg2": 2},
    }
    assert values == {"seconds": 60, "set": {"pretension": 3, "vertebrae": 6}, "seeds": [1, 2]}


@pytest.mark.parametrize(("chosen", "void"), [("command_csv", "given_pull_m"), ("randomize", "ranges")])
def test_a_choice_makes_the_other_one_void(chosen, void):
    assert change_recipe({void: [1.0, 2.0]}, {chosen: "x"}) == {chosen: "x"}
    assert change_recipe({void: [1.0, 2.0]}, {"seconds": 1}) == {void: [1.0, 2.0], "seconds": 1}


def test_columns_of_a_command_are_changed_beside_its_path():
    column = {"command_csv": {"command_column": "knob_deg"}}
    assert change_recipe({"command_csv": "a.csv"}, column) == {
        "command_csv": {"file": "a.csv", "command_column": "knob_deg"}
    }
    other = {"command_csv": {"file": "b.csv"}, "given_lateral_pull_m": [0.0, 1.0]}
    assert change_recipe(other, column) == {"command_csv": {"file": "b.csv", "command_column": "knob_deg"}}


@pytest.mark.parametrize(("episodes", "met"), [(1, 1), (2, 2), (3, 3), (4, None)])
def test_episodes_that_do_not_meet_every_stroke_and_bend_are_told(episodes, met):
    bends = ((0.0, 0.0), (90.0, 90.0))
    recipe = changed(
        signals=("sine",), strokes_mm=((-1.0, 1.0), (0.0, 1.0)), sheath_bends_deg=bends, episodes=episodes
    )
    warning = recipe.unmet
    if met is None:
        assert warning is None
    else:
        count = f"{episodes} episode{'s' * (episodes > 1)}"
        assert warning == (
            f"{count} of each seed meet only {met} of 4 pairs of stroke and bend; for all, take 4"
        )
