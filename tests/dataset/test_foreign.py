"""A user's own files in the folder of a dataset are not written over, whatever their names."""

import shutil

import pytest
import yaml
from small_dataset import RECIPE, changed, contents, make

from twin.dataset.recipe import to_yaml
from twin.dataset.write import write_dataset

OWN = "the user's own"


class NoWork:
    """An executor of which nothing may be asked."""

    def submit(self, *_):
        raise AssertionError("something is simulated")


def files_of(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("name", ["README.md", "loops.png", "episode_0000.csv", "episode_0001.mcap"])
@pytest.mark.parametrize("own_recipe", [False, True])
def test_a_file_of_our_names_that_we_did_not_make_is_refused_before_any_work(tmp_path, name, own_recipe):
    (tmp_path / name).write_text(OWN)
    if own_recipe:
        (tmp_path / "recipe.yaml").write_text("# mine\n" + to_yaml(RECIPE))
    before = files_of(tmp_path)
    with pytest.raises(ValueError, match=rf"^[^\n]*({name}|holds a dataset without a recipe)"):
        write_dataset(RECIPE, tmp_path, NoWork(), csv=True)
    assert files_of(tmp_path) == before


@pytest.mark.parametrize("name", ["README.md", "loops.png", "dataset.json", "episode_0001.csv"])
def test_a_link_of_our_names_is_not_written_over(tmp_path, name):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ValueError, match=f"{name} is a link"):
        write_dataset(RECIPE, folder, NoWork(), csv=True)
    assert (folder / name).is_symlink()


def test_a_card_that_was_changed_stays_and_one_that_was_not_follows_the_dataset(dataset_copy):
    before = (dataset_copy / "README.md").read_text()
    more = changed(episodes=RECIPE.episodes + 1)
    make(dataset_copy, more)
    followed = (dataset_copy / "README.md").read_text()
    assert followed != before
    (dataset_copy / "README.md").write_text(OWN)
    make(dataset_copy, changed(episodes=RECIPE.episodes + 2))
    assert (dataset_copy / "README.md").read_text() == OWN


def test_a_table_that_is_not_of_the_episode_beside_it_is_not_written_over(tmp_path):
    make(tmp_path, RECIPE)
    (tmp_path / "episode_0001.csv").write_text(OWN)
    with pytest.raises(ValueError, match=r"episode_0001\.csv is there, and `generate` did not make it"):
        make(tmp_path, RECIPE, csv=True)
    assert (tmp_path / "episode_0001.csv").read_text() == OWN


def test_what_a_killed_run_has_made_of_a_recipe_of_the_users_own_is_gone_on_from(tmp_path, dataset_copy):
    folder = tmp_path / "out"
    shutil.copytree(dataset_copy, folder)
    own = "# mine\n" + yaml.safe_dump(yaml.safe_load(to_yaml(RECIPE)))
    (folder / "recipe.yaml").write_text(own)
    (folder / "dataset.json").unlink()
    make(folder, RECIPE)
    assert (folder / "recipe.yaml").read_text() == own
    assert contents(folder)["README.md"] == contents(dataset_copy)["README.md"]
