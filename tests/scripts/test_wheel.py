"""The built wheel, installed elsewhere: every verb runs, and with the core alone files and estimators do."""

import dataclasses
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from recorded import make_episode

import twin
from rl.options import TrainingOptions
from rl.training import train_policy
from scripts.__main__ import VERBS

REPOSITORY = Path(__file__).resolve().parents[2]
EXTRAS = ("mujoco", "torch", "matplotlib", "pymoo", "PIL", "gymnasium", "onnx", "viser")

ESTIMATE = """
import importlib.util, json, sys
import numpy as np
import twin

episode = twin.read_episode(sys.argv[1])
model = twin.ColemanHodgdon(1.15, 22.38, 5.0)
sensed = twin.ActiveModel(model, episode.sample_time).with_sensor(twin.Sensor(variance=0.5))
online = twin.OnlineEstimator(sensed, episode.sample_time, float(episode.truth_deg[0]))
samples = zip(episode.time, episode.pull_mm, episode.measured_deg)
estimate = [online.push(*map(float, sample)) for sample in samples]
policy = twin.load_estimator(sys.argv[2], twin.Sensor(variance=0.5))
steered = policy.estimate(episode.pull_mm, episode.measured_deg[None], float(episode.truth_deg[0]))[0]
try:
    twin.Endoscope
    refused = ""
except twin.EndoTwinError as error:
    refused = str(error)
found = [name for name in sys.argv[3:] if importlib.util.find_spec(name)]
found_here = {"home": twin.__file__, "estimate": estimate, "steered": steered.tolist()}
print(json.dumps(found_here | {"refused": refused, "found": found}))
"""


def run(*words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a program that sees nothing of this checkout."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run([*map(str, words)], cwd=cwd, capture_output=True, text=True, env=environment)


def make_environment(folder: Path, *, install: list[object]) -> Path:
    """A new virtual environment with packages that pip installs; returns its folder of programs."""
    made = run(sys.executable, "-m", "venv", "--without-pip", folder, cwd=folder.parent)
    assert made.returncode == 0, made.stderr
    pip = [sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "install", "--quiet"]
    done = run(*pip, "--no-compile", "--disable-pip-version-check", *install, cwd=folder.parent)
    assert done.returncode == 0, done.stderr
    return folder / "bin"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    built = run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=REPOSITORY)
    assert built.returncode == 0, built.stderr
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def programs(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with the wheel, which sees the packages of this one, but not its checkout."""
    folder = tmp_path_factory.mktemp("all") / "environment"
    found = make_environment(folder, install=["--no-deps", "--no-index", wheel])
    (site,) = folder.glob("lib/python*/site-packages")
    others = [path for path in sys.path if path.endswith(("site-packages", "dist-packages"))]
    (site / "others.pth").write_text("\n".join(others) + "\n")
    return found


@pytest.fixture
def core(wheel: Path, tmp_path: Path) -> Path:
    """A fresh environment with the core alone, really installed."""
    probe = (
        sys.executable,
        "-m",
        "pip",
        "download",
        "--quiet",
        "--no-deps",
        "-d",
        tmp_path / "probe",
        "mcap",
    )
    if run(*probe, cwd=tmp_path).returncode:
        pytest.skip("no package index can be reached: pip cannot download mcap")
    return make_environment(tmp_path / "core", install=["-c", REPOSITORY / "constraints.txt", wheel])


def test_the_wheel_installs_two_packages_and_their_files(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert wheel.name == f"endotwin-{twin.__version__}-py3-none-any.whl"
    tops = {"twin", "rl", f"endotwin-{twin.__version__}.dist-info"}
    assert {name.partition("/")[0] for name in names} == tops
    assert {"twin/py.typed", "rl/py.typed", "twin/assets/ureteroscope.yaml"} <= {*names}
    assert "twin/scripts/command.py" in names
    assert not [name for name in names if "__pycache__" in name or name.startswith("tests")]


@pytest.mark.slow
def test_every_verb_answers_from_the_wheel(programs, tmp_path):
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts" / "__init__.py").write_text("raise ImportError('a folder of the user')")
    assert run(programs / "endotwin", "--version", cwd=tmp_path).stdout == f"endotwin {twin.__version__}\n"
    for verb in VERBS:
        done = run(programs / "endotwin", verb, "--help", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert done.stdout.startswith(f"usage: endotwin {verb} ")
        assert done.stderr == ""
    by_module = run(programs / "python", "-m", "twin", "generate", "--help", cwd=tmp_path)
    assert by_module.returncode == 0, by_module.stderr


@pytest.mark.slow
def test_generate_writes_a_dataset_from_the_wheel(programs, tmp_path):
    words = (
        "generate --preset ureteroscope --episodes 2 --seconds 1 --stroke -1 1 --workers 2 --out data --json"
    )
    done = run(programs / "endotwin", *words.split(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["episodes"] == 2
    where = run(programs / "python", "-c", "import twin; print(twin.__file__)", cwd=tmp_path)
    assert Path(where.stdout.strip()).is_relative_to(programs.parent)
    assert len(twin.read_episode(tmp_path / "data" / "episode_0001.mcap").time) == 50
    again = run(programs / "endotwin", "generate", "--verify", "--out", "data", cwd=tmp_path)
    assert again.returncode == 0, again.stderr


def _possible(episode: twin.Episode) -> twin.Episode:
    """The episode with a pull and angles that an endoscope can have: a live stream refuses others."""
    phase = 2 * np.pi * episode.time / 5
    bend = np.radians(20) * np.sin(phase)
    measured = bend + 1e-3 * episode.measured_bend
    return dataclasses.replace(episode, pull=1e-3 * np.sin(phase + 0.3), bend=bend, measured_bend=measured)


@pytest.mark.slow
def test_with_the_core_alone_files_are_read_and_estimators_run(core, tmp_path, records, model):
    episode = _possible(make_episode(300, seed=3))
    twin.write_episode(tmp_path / "episode.mcap", episode)
    few = TrainingOptions(episodes=8, environments=8, horizon=256, minibatch=64)
    policy = train_policy(records, twin.ActiveModel(model, 0.1), few, tmp_path / "run")
    words = (tmp_path / "episode.mcap", policy, *EXTRAS)
    done = run(core / "python", "-c", ESTIMATE, *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    there = json.loads(done.stdout)
    assert Path(there["home"]).is_relative_to(tmp_path)
    assert there["found"] == []
    assert there["refused"] == "twin.Endoscope needs mujoco: pip install 'endotwin[sim]'"

    sensed = twin.ActiveModel(twin.ColemanHodgdon(1.15, 22.38, 5.0), episode.sample_time)
    sensed = sensed.with_sensor(twin.Sensor(variance=0.5))
    start = np.array([episode.truth_deg[0]])
    here = sensed.estimate(episode.pull_mm, episode.measured_deg[None], start)[0]
    np.testing.assert_allclose(there["estimate"], here, rtol=1e-12)
    steered = twin.load_estimator(policy, twin.Sensor(variance=0.5))
    here = steered.estimate(episode.pull_mm, episode.measured_deg[None], start)[0]
    np.testing.assert_allclose(there["steered"], here, rtol=1e-9)

    for verb, extra in {
        "generate --out data": "mujoco: pip install 'endotwin[sim]'",
        "render episode.mcap --out bend.png": "mujoco: pip install 'endotwin[sim]'",
        "identify episode.mcap --out model.json": "pymoo: pip install 'endotwin[sim]'",
        "report . --out report.html": "matplotlib: pip install 'endotwin[viz]'",
    }.items():
        refused = run(core / "endotwin", *verb.split(), cwd=tmp_path)
        line = f"endotwin {verb.split()[0]}: this needs {extra}\n"
        assert (refused.returncode, refused.stderr, refused.stdout) == (2, line, "")
    table = run(
        core / "endotwin", "export", "episode.mcap", "--format", "csv", "--out", "table", cwd=tmp_path
    )
    assert table.returncode == 0, table.stderr
    assert len((tmp_path / "table" / "episode.csv").read_text().splitlines()) == 301
