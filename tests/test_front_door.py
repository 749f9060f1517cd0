"""`import twin`: what a notebook needs is there, documented, and loaded when it is first used."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import twin

REPOSITORY = Path(__file__).resolve().parents[1]
NEEDED = {
    "ActiveModel",
    "ColemanHodgdon",
    "Episode",
    "OnlineEstimator",
    "Preset",
    "Recipe",
    "Sensor",
    "error_indices",
    "evaluate",
    "identify",
    "load_estimator",
    "load_model",
    "load_preset",
    "method_specs",
    "preset_names",
    "read_dataset",
    "read_episode",
    "recover_episode",
    "render",
    "simulate",
    "simulate_batch",
    "write_dataset",
    "write_episode",
}


def modules_after(code: str) -> set[str]:
    """The modules that a fresh Python has imported after some code."""
    program = f"{code}\nimport sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize("name", twin.__all__)
def test_a_public_name_is_what_its_home_defines_and_says_what_it_is(name):
    found = getattr(twin, name)
    assert found.__name__ == name
    assert found.__module__.startswith(("twin.", "rl."))
    assert inspect.getdoc(found)


def test_names_are_listed_for_people_and_for_type_checkers():
    assert set(twin.__all__) >= NEEDED
    assert set(dir(twin)) >= {*twin.__all__, "__version__"}
    source = ast.parse(Path(twin.__file__).read_text())
    (checked,) = (node for node in source.body if isinstance(node, ast.If))
    told = {alias.name: node.module for node in checked.body for alias in node.names}
    assert told == twin._HOME


def test_a_wrong_name_is_told_with_the_right_ones():
    with pytest.raises(AttributeError, match=r"has no attribute 'simulte'; it has .*simulate"):
        _ = twin.simulte
    assert not hasattr(twin, "numpy")


def test_import_is_light():
    modules = modules_after("import twin") - modules_after("pass")
    assert {name.partition(".")[0] for name in modules} - sys.stdlib_module_names == {"twin"}
    assert modules & {"typing", "dataclasses", "inspect"} <= {"typing"}


@pytest.mark.parametrize(
    ("name", "unused"),
    [
        ("load_preset", {"mujoco", "matplotlib", "scipy", "mcap"}),
        ("read_episode", {"mujoco", "matplotlib", "torch", "scipy"}),
        ("OnlineEstimator", {"mujoco", "matplotlib", "torch", "mcap"}),
        ("ColemanHodgdon", {"mujoco", "matplotlib", "torch", "mcap", "pymoo"}),
        ("error_indices", {"mujoco", "matplotlib", "torch", "mcap", "pymoo"}),
        ("simulate", {"matplotlib", "torch", "pymoo", "mcap"}),
    ],
)
def test_a_name_brings_only_what_it_needs(name, unused):
    assert modules_after(f"import twin; twin.{name}") & unused == set()


def test_a_name_whose_extra_is_missing_says_what_to_install():
    code = (
        "import sys, twin\nsys.modules['mujoco'] = None\n"
        "try: twin.Endoscope\n"
        "except ImportError as error: print(isinstance(error, twin.EndoTwinError), error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True twin.Endoscope needs mujoco: pip install 'endotwin[sim]'\n"
