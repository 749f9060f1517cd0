"""What is in the folder already: another dataset is neither overwritten nor mixed with the new one."""

import shutil

import mujoco
import pytest
from small_dataset import SECOND, SMALL, changed, contents, identities, make, measured_log

from twin.measured.folder import write_measured
from twin.preset.randomization import Ranges


@pytest.mark.parametrize(
    ("change", "other"),
    [
        ({"strokes_mm": ((-1.0, 1.5),)}, "strokes_mm"),
        ({"seconds": 2.0, "sensor_variance_deg2": 0.2}, "seconds, sensor"),
        ({"preset": SMALL.replace(pretension=3.1)}, "preset"),
        ({"ranges": Ranges((("pretension", 1.0, 6.0),))}, "ranges"),
        ({"sheath_bends_deg": ((0.0, 90.0),)}, "sheath_bends_deg"),
    ],
)
def test_another_recipe_is_refused_before_anything_is_touched(dataset_copy, whole_dataset, change, other):
    before = identities(dataset_copy)
    with pytest.raises(
        ValueError, match=rf"holds a dataset of another recipe \(other {other}\): "
    ) as refused:
        make(dataset_copy, changed(**change), csv=True)
    assert "choose another `folder` or remove it" in str(refused.value)
    assert "\n" not in str(refused.value)
    assert identities(dataset_copy) == before
    assert contents(dataset_copy) == contents(whole_dataset)


def test_fewer_episodes_and_foreign_files_are_refused_before_anything_is_touched(dataset_copy, whole_dataset):
    with pytest.raises(ValueError, match=r"holds episode_0002\.mcap, which is not among the 2 episodes"):
        make(dataset_copy, changed(episodes=2), csv=True)
    assert contents(dataset_copy) == contents(whole_dataset)
    shutil.copy(dataset_copy / SECOND, dataset_copy / "other.mcap")
    with pytest.raises(ValueError, match=r"holds other\.mcap, which is not among the 3 episodes"):
        make(dataset_copy, csv=True)


def test_recipe_that_is_gone_is_written_again_where_dataset_json_tells_it(dataset_copy, whole_dataset):
    (dataset_copy / "recipe.yaml").unlink()
    with pytest.raises(ValueError, match=r"another recipe \(other seconds\)"):
        make(dataset_copy, changed(seconds=2.0), csv=True)
    assert make(dataset_copy, csv=True).kept == 3
    assert contents(dataset_copy) == contents(whole_dataset)


def test_other_seeds_are_another_recipe(dataset_copy, whole_dataset):
    with pytest.raises(ValueError, match=r"holds a dataset of another recipe \(other seeds\)"):
        make(dataset_copy, changed(seeds=(12,)), csv=True)
    assert contents(dataset_copy) == contents(whole_dataset)


def test_whole_dataset_of_another_version_is_not_made_anew(dataset_copy):
    path = dataset_copy / "dataset.json"
    path.write_text(path.read_text().replace(f'"mujoco": "{mujoco.__version__}"', '"mujoco": "2.0.1"'))
    before = contents(dataset_copy)
    with pytest.raises(ValueError, match=r"holds a dataset of mujoco 2\.0\.1, here is .*: choose another"):
        make(dataset_copy, csv=True)
    assert contents(dataset_copy) == before


def test_episodes_without_their_recipe_are_refused(dataset_copy):
    for name in ("recipe.yaml", "dataset.json"):
        (dataset_copy / name).unlink()
    before = contents(dataset_copy)
    with pytest.raises(ValueError, match=r"holds a dataset without a recipe\.yaml: choose another `folder`"):
        make(dataset_copy, csv=True)
    assert contents(dataset_copy) == before


def test_damaged_dataset_file_is_refused_with_what_to_do(dataset_copy, whole_dataset):
    (dataset_copy / "dataset.json").write_text("{")
    with pytest.raises(
        ValueError, match=r"dataset\.json is damaged .*not JSON.*; remove it, and generate the dataset again"
    ):
        make(dataset_copy, csv=True)
    (dataset_copy / "dataset.json").unlink()
    make(dataset_copy, csv=True)
    assert contents(dataset_copy) == contents(whole_dataset)


def test_recipe_that_a_user_wrote_into_the_folder_stays_as_it_is(tmp_path):
    make(tmp_path / "ours")
    text = "# mine\n" + (tmp_path / "ours" / "recipe.yaml").read_text()
    (tmp_path / "recipe.yaml").write_text(text)
    make(tmp_path)
    make(tmp_path)
    assert (tmp_path / "recipe.yaml").read_text() == text
    for other in (changed(seconds=0.5), changed(episodes=4)):
        with pytest.raises(ValueError, match=r"recipe\.yaml is not what `generate` wrote, nor this recipe"):
            make(tmp_path, other)
    assert (tmp_path / "recipe.yaml").read_text() == text


def test_folder_of_measured_logs_is_refused(tmp_path):
    (tmp_path / "data").mkdir()
    write_measured(tmp_path / "data", "log", measured_log(tmp_path))
    before = contents(tmp_path / "data")
    with pytest.raises(
        ValueError, match=r"`generate` did not make \(source measured\): choose another `folder`"
    ):
        make(tmp_path / "data")
    assert contents(tmp_path / "data") == before
