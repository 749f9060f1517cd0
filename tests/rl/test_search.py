"""Search of settings: all of the grid are tried, the best on held-out twins is trained with."""

import csv
import re
from concurrent.futures import ThreadPoolExecutor

import pytest
from small_twins import twins

from rl import sweep
from rl.on_twins import RAM_MEMORY_SETTINGS, RIVALS
from rl.options import TrainingOptions
from rl.sweep import FILE, grid_of, search_settings, with_settings
from rl.trainers import Material, Simulated, find_trainer
from twin.estimation.learned.trained_file import read_trained_file
from twin.files.run_folder import read_progress

OPTIONS = TrainingOptions(agent="gru-twins", episodes=1, seed=2)


@pytest.fixture
def material():
    return Material(simulated=Simulated(*twins(), {"noises": ("gaussian",)}))


def trials_of(material, folder):
    with ThreadPoolExecutor(1) as executor:
        return search_settings(material, OPTIONS, folder, executor)


def test_every_rival_is_given_a_grid_of_the_same_size_around_its_own_settings():
    for name, rival in RIVALS.items():
        grid = grid_of(rival.spec.training.agent)
        assert len(grid) == 6, name
        assert {"learning_rate": rival.rate, "width": rival.width} in grid
    grid = grid_of("ram-memory")
    assert len(grid) == 6
    assert {"learning_rate": RAM_MEMORY_SETTINGS.learning_rate, "width": RAM_MEMORY_SETTINGS.width} in grid


@pytest.mark.slow
def test_the_best_on_held_out_twins_comes_first_and_is_trained_with(material, tmp_path, monkeypatch):
    monkeypatch.setattr(sweep, "grid_of", lambda _: [{"width": 4}, {"width": 7}])
    trials = trials_of(material, tmp_path)
    errors = {trial.settings["width"]: trial.error_deg2 for trial in trials}
    for width, error in errors.items():
        curve = read_progress(tmp_path / f"width_{width}" / "progress.csv")
        assert error == pytest.approx(-curve["return"].max(), rel=1e-5)
        file = read_trained_file(tmp_path / f"width_{width}" / "network.onnx")
        assert file.description["training"]["width"] == width
        assert file.description["training"]["seed"] == OPTIONS.seed
    assert [trial.error_deg2 for trial in trials] == sorted(errors.values())
    with (tmp_path / FILE).open() as file:
        rows = [(int(row["width"]), float(row["held_out_error_deg2"])) for row in csv.DictReader(file)]
    assert rows == [(trial.settings["width"], pytest.approx(trial.error_deg2, rel=1e-5)) for trial in trials]

    made = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/network.onnx")}
    assert trials_of(material, tmp_path) == trials
    assert made == {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/network.onnx")}

    chosen = with_settings(material, trials[0].settings)
    path = find_trainer("gru-twins").run(chosen, OPTIONS, tmp_path / "trained")
    assert read_trained_file(path).description["training"]["width"] == trials[0].settings["width"]


def test_a_method_without_a_grid_is_refused_and_those_with_one_are_named():
    message = "agent 'ram' has no settings to search; valid: bias-kalman-net-twins, gru-twins, "
    with pytest.raises(ValueError, match=re.escape(message)):
        grid_of("ram")
