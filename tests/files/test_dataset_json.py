"""The schema of `dataset.json`: what does not fit is refused in one line that names the key and the rule."""

import json
import subprocess
import sys

import pytest
from dataset_contents import FEATURE, FIGURES, FILE, contents

from twin.files.dataset_json import parse_contents, read_contents, to_json_values, write_contents


def refusal(values) -> str:
    with pytest.raises(ValueError, match=r".") as refused:
        parse_contents(json.dumps(values))
    assert "\n" not in str(refused.value)
    assert "pydantic" not in str(refused.value)
    return str(refused.value)


def test_contents_come_back_from_their_file(tmp_path):
    write_contents(tmp_path, contents())
    assert to_json_values(read_contents(tmp_path)) == contents()
    with pytest.raises(ValueError, match=r"unknown key colour.*; remove it, .* measured logs, import again"):
        write_contents(tmp_path, contents(colour=1))
    assert to_json_values(read_contents(tmp_path)) == contents()


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"colour": 1}, "unknown key colour; valid: source, endotwin, episodes, seconds, bytes, features,"),
        (
            {"files": [FILE | {"colour": 1}]},
            "unknown key files[0].colour; valid: name, samples, seconds, bytes, sha256, statistics, csv,",
        ),
        (
            {"statistics": {"truth_deg": FIGURES | {"median": 1}}},
            "unknown key statistics.truth_deg.median; valid: count, max, mean, min, std",
        ),
        ({"source": "simulated"}, "mujoco is missing"),
        ({"source": "guessed"}, "source = 'guessed': must be simulated, measured or benchmark"),
        ({"episodes": "1"}, "episodes = '1': must be a valid integer"),
        ({"episodes": True}, "episodes = True: must be a valid integer"),
        ({"episodes": 0}, "episodes = 0: must be greater than or equal to 1"),
        ({"seconds": float("nan")}, "it holds NaN, which is no number; remove it"),
        ({"files": []}, "files = []: must have at least 1 item"),
        ({"files": [FILE, FILE]}, "files: a.mcap is there twice"),
        ({"files": [FILE | {"name": "../a.mcap"}]}, "files[0].name = '../a.mcap': must match pattern"),
        ({"files": [FILE | {"sha256": "0"}]}, "files[0].sha256 = '0': must match pattern"),
        ({"features": {"truth_deg": FEATURE | {"shape": 3}}}, "features.truth_deg.shape = 3: must be"),
    ],
)
def test_what_does_not_fit_is_named_with_the_rule(changes, fault):
    assert refusal(contents(**changes)).startswith(fault)


@pytest.mark.parametrize(
    ("module", "unwanted"),
    [
        ("twin.files.dataset_json", {"numpy", "mujoco", "mcap", "scipy", "matplotlib"}),
        ("twin", {"pydantic"}),
        ("twin.recording", {"pydantic"}),
        ("twin.export.columns", {"pydantic"}),
    ],
)
def test_schema_is_light_and_loaded_only_where_it_is_needed(module, unwanted):
    program = f"import sys, {module}; print(*(name.split('.')[0] for name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not unwanted & set(done.stdout.split())
