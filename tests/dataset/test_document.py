"""The example of a recipe is one, and shows every key."""

import yaml

from twin.dataset.recipe_file import RESOLVED_KEYS, RecipeFile, load_recipe
from twin.files.assets import assets_folder


def test_example_recipe_is_one_and_shows_every_key():
    path = assets_folder() / "datasets" / "mixed.yaml"
    recipe = load_recipe(path)
    assert len(recipe.keys) == 40
    assert {recipe.conditions(number).stroke_mm for number in range(20)} == {(2, 4), (-1, 1)}
    text = path.read_text()
    for key in RecipeFile.model_fields:
        assert f"{key}:" in text or key in RESOLVED_KEYS, key
    assert yaml.safe_load(text.replace("# camera", "camera"))["camera"]["width"] == 320
