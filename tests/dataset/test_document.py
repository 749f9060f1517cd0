"""The document of datasets describes every field, key and file that there is."""

import json
import re

import pytest
import yaml
from repository import REPOSITORY
from small_dataset import SMALL, make

from twin.dataset.recipe import Recipe
from twin.dataset.recipe_file import RESOLVED_KEYS, CommandFile, RecipeFile, SensorFile, load_recipe
from twin.files.assets import assets_folder
from twin.recording import endotwin_pb2, read_episode

DOCUMENT = (REPOSITORY / "docs" / "dataset.md").read_text()


def described(name: str) -> bool:
    return re.search(rf"\b{re.escape(name)}\b", DOCUMENT) is not None


@pytest.mark.parametrize("message", endotwin_pb2.DESCRIPTOR.message_types_by_name.values())
def test_every_field_of_our_messages_is_described(message):
    for field in message.fields_by_name:
        of_any_wire = re.sub(r"_[abcd]_(?=n$|mm$)", "_*_", field)
        assert f"`{of_any_wire}`" in DOCUMENT, field


@pytest.mark.parametrize(
    "key", [*RecipeFile.model_fields, *SensorFile.model_fields, *CommandFile.model_fields]
)
def test_every_key_of_a_recipe_is_described(key):
    if key not in RESOLVED_KEYS:
        assert described(key)


def test_every_key_of_dataset_json_and_of_the_metadata_is_described(tmp_path):
    recipe = Recipe(SMALL, seconds=1.0, episodes=1, sheath_bends_deg=((0.0, 90.0),))
    make(tmp_path / "data", recipe, csv=True)
    contents = json.loads((tmp_path / "data/dataset.json").read_text())
    keys = {
        *contents,
        *contents["files"][0],
        *contents["features"]["truth_deg"],
        *contents["statistics"]["truth_deg"],
    }
    for key in keys | set(read_episode(tmp_path / "data/episode_0000.mcap").metadata):
        assert described(key), key
    for path in (tmp_path / "data").iterdir():
        assert path.name in DOCUMENT


def test_example_recipe_is_one_and_shows_every_key():
    path = assets_folder() / "datasets" / "mixed.yaml"
    recipe = load_recipe(path)
    assert len(recipe.keys) == 40
    assert {recipe.conditions(number).stroke_mm for number in range(20)} == {(2, 4), (-1, 1)}
    text = path.read_text()
    for key in RecipeFile.model_fields:
        assert f"{key}:" in text or key in RESOLVED_KEYS, key
    assert yaml.safe_load(text.replace("# camera", "camera"))["camera"]["width"] == 320
