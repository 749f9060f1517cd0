"""The house is in order: packages, not loose files; tests that mirror them; one direction of imports."""

import ast
import collections
from pathlib import Path

import pytest
from repository import REPOSITORY
from source_tree import source_files

KNOWN_ONLY_IN = {
    "mujoco": ("twin/physics/", "twin/errors.py"),
    "dm_control": ("twin/physics/",),
    "mcap": ("twin/recording/",),
    "torch": ("rl/",),
    "stable_baselines3": ("rl/",),
    "gymnasium": ("rl/",),
}
"""Libraries and the packages that may import them."""


def imports(tree: ast.Module) -> set[str]:
    """Full names of all modules that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
    return found


def test_each_folder_of_tests_is_a_package_of_the_product():
    packages = {path.parent.name for path in (REPOSITORY / "twin").glob("*/__init__.py")} | {"rl", "scripts"}
    folders = {path.parent.name for path in (REPOSITORY / "tests").glob("*/**/test_*.py")}
    assert folders <= packages


def test_hardly_a_file_is_loose():
    loose = {path.name for path in (REPOSITORY / "twin").glob("*.py")} - {"__init__.py"}
    assert loose == {"__main__.py", "episode.py", "errors.py"}


def test_imports_go_one_way():
    for folder, above in (("twin", {"rl", "scripts"}), ("rl", {"scripts"})):
        for name, tree in source_files(folder):
            assert not {module.partition(".")[0] for module in imports(tree)} & above, name


@pytest.mark.parametrize("library", sorted(KNOWN_ONLY_IN))
def test_a_library_is_known_in_its_package_alone(library):
    for name, tree in source_files("twin", "rl", "scripts"):
        if library in {module.partition(".")[0] for module in imports(tree)}:
            assert name.startswith(KNOWN_ONLY_IN[library]), name


def test_estimation_and_physics_know_nothing_of_each_other():
    apart = {"twin/estimation/": "twin.physics", "twin/physics/": "twin.estimation"}
    for folder, other in apart.items():
        for name, tree in source_files(folder.rstrip("/")):
            assert not [module for module in imports(tree) if module.startswith(other)], name


def test_a_class_has_one_name_and_a_name_one_class():
    classes = collections.defaultdict(list)
    for name, tree in source_files("twin", "rl", "scripts"):
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                classes[node.name].append(name)
    assert not {name: places for name, places in classes.items() if len(places) > 1}


def test_versions_and_files_of_the_house_are_there():
    for name in ("CONTRIBUTING.md", "CHANGELOG.md", "CITATION.cff", "docs/glossary.md", "twin/py.typed"):
        assert Path(REPOSITORY / name).is_file(), name
