"""The command line and the library start at once: what a verb needs is imported when it runs."""

import dataclasses
import subprocess
import sys

import pytest

from scripts.__main__ import VERBS
from scripts.import_log import Import
from twin.measured.log import LogFormat

HEAVY = {"dm_control", "gymnasium", "matplotlib", "mcap", "mujoco", "numpy", "onnxruntime", "pydantic"}
HEAVY |= {"pymoo", "scipy", "stable_baselines3", "torch", "tqdm", "yaml"}
OF_LEARNING = {"train", "evaluate"}
"""Their options are in `rl`, whose import registers the environments with Gymnasium, which needs NumPy."""
SAID = (
    "import sys; sys.argv[1:] = {words!r}\n{code}\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
)
MAIN = "from twin.__main__ import main\nassert main() == 0"


def imported(code: str, *words: str) -> tuple[str, set[str]]:
    """Return what code prints with these words on the command line, and the modules it imported."""
    program = SAID.format(words=list(words), code=code)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    printed, _, modules = done.stdout.rstrip().rpartition("\n")
    return printed, set(modules.split())


@pytest.mark.parametrize("verb", [pytest.param(v, marks=[pytest.mark.slow] * (v != "run")) for v in VERBS])
def test_help_of_a_verb_imports_nothing_heavy(verb):
    printed, modules = imported(MAIN, verb, "--help")
    assert printed.startswith(f"usage: endotwin {verb} ")
    assert "--json" in printed
    assert modules & HEAVY == ({"numpy", "gymnasium"} if verb in OF_LEARNING else set())


def test_the_list_of_verbs_needs_no_parser():
    printed, modules = imported(MAIN, "--help")
    assert printed.startswith("usage: endotwin VERB")
    assert modules & (HEAVY | {"tyro"}) == set()


def test_defaults_of_import_are_those_of_the_library():
    """They stand in the verb too, which cannot import the library before it runs."""
    form = LogFormat()
    for field in dataclasses.fields(Import):
        if field.name == "pulley_radius_mm":
            assert field.default * 1e-3 == pytest.approx(form.pulley_radius)
        elif hasattr(form, field.name):
            assert (field.default or None) == (getattr(form, field.name) or None), field.name
