"""The house is in order: packages, not loose files; tests that mirror them; one direction of imports."""

import ast
import collections
from pathlib import Path

import pytest
from repository import REPOSITORY
from source_tree import source_files

KNOWN_ONLY_IN = {
    "cv2": ("twin/vision/",),
    "mujoco": ("twin/physics/", "twin/errors.py"),
    "dm_control": ("twin/physics/",),
    "mcap": ("twin/recording/",),
    "torch": ("rl/",),
    "stable_baselines3": ("rl/",),
    "gymnasium": ("rl/",),
}
"""Libraries and the packages that may import them."""
RUNS_FILES = {
    "pickle",
    "cPickle",
    "_pickle",
    "cloudpickle",
    "dill",
    "shelve",
    "marshal",
    "joblib",
    "jsonpickle",
}
"""Modules that run code out of the files that they read."""
UNSAFE_YAML = {"yaml.Loader", "yaml.CLoader", "yaml.FullLoader", "yaml.CFullLoader", "yaml.full_load"}


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


def unsafe(tree: ast.Module) -> list[str]:
    """What of a file could run code out of a file that is read."""
    found = [module for module in imports(tree) if module.partition(".")[0] in RUNS_FILES]
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute):
            name = ast.unparse(node)
            if name in {"eval", "exec", "builtins.eval", "builtins.exec", "torch.jit.load"}:
                found.append(name)
            if isinstance(node, ast.Attribute) and name.split(".")[0] in RUNS_FILES:
                found.append(name)
            if name.startswith("yaml.") and ("unsafe" in name.lower() or name in UNSAFE_YAML):
                found.append(name)
        if not isinstance(node, ast.Call):
            continue
        called, keywords = ast.unparse(node.func), {k.arg: ast.unparse(k.value) for k in node.keywords}
        if called == "PPO.load" or keywords.get("allow_pickle", "False") != "False":
            found.append(ast.unparse(node))
        if (called == "torch.load") != (keywords.get("weights_only", "") == "True"):
            found.append(ast.unparse(node))
        if called in ("yaml.load", "yaml.load_all") and "Loader" not in keywords and len(node.args) < 2:
            found.append(ast.unparse(node))
    return found


def test_nothing_that_is_read_from_a_file_is_run():
    for name, tree in source_files("twin", "rl", "scripts"):
        assert not unsafe(tree), name


@pytest.mark.parametrize(
    "text",
    [
        "import pickle",
        "from dill import loads",
        "import joblib as j",
        "eval('1')",
        "run = exec",
        "np.load(path, allow_pickle=True)",
        "torch.load(path)",
        "torch.load(path, weights_only=False)",
        "PPO.load(path)",
        "yaml.load(text)",
        "yaml.load(text, Loader=yaml.UnsafeLoader)",
        "yaml.load(text, yaml.Loader)",
        "yaml.unsafe_load(text)",
    ],
)
def test_what_would_run_a_file_is_found(text):
    assert unsafe(ast.parse(text))


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
