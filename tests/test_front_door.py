"""`import twin`: its public names are defined, documented, and imported only when they are used."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import twin


def modules_after(code: str) -> set[str]:
    """The modules that a fresh Python has imported after some code."""
    program = f"{code}\nimport sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_public_names_are_documented_and_known_to_type_checkers():
    for name in twin.__all__:
        found = getattr(twin, name)
        assert found.__name__ == name
        assert found.__module__.startswith(("twin.", "rl."))
        assert inspect.getdoc(found), name
    assert set(dir(twin)) >= {*twin.__all__, "__version__"}
    (checked,) = (
        node for node in ast.parse(Path(twin.__file__).read_text()).body if isinstance(node, ast.If)
    )
    assert {alias.name: node.module for node in checked.body for alias in node.names} == twin._HOME


def test_a_wrong_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="simulate"):
        _ = twin.simulte
    assert not hasattr(twin, "numpy")


def test_import_is_light_and_a_name_imports_only_what_it_needs():
    modules = modules_after("import twin") - modules_after("pass")
    assert {name.partition(".")[0] for name in modules} - sys.stdlib_module_names == {"twin"}
    light = "import twin; twin.load_preset, twin.OnlineEstimator, twin.ColemanHodgdon, twin.error_indices"
    assert not modules_after(light) & {"mujoco", "matplotlib", "torch", "mcap", "pymoo"}
    assert not modules_after("import twin; twin.read_episode") & {"mujoco", "matplotlib", "torch", "scipy"}


def test_a_name_whose_extra_is_missing_says_what_to_install():
    code = (
        "import sys, twin\nsys.modules['mujoco'] = None\n"
        "try: twin.Endoscope\n"
        "except ImportError as error: print(isinstance(error, twin.EndoTwinError), error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True twin.Endoscope needs mujoco: pip install 'endotwin[sim]'\n"
