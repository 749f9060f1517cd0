"""The structure of the product: one direction of imports, no content of a file is run, declared libraries."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from repository import REPOSITORY

import twin
from twin import errors

PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
OWN = ("twin", "rl", "scripts")
HOME_OF = {
    "cv2": ("twin/vision/",),
    "mujoco": ("twin/physics/", "twin/errors.py"),
    "dm_control": ("twin/physics/",),
    "mcap": ("twin/recording/",),
    "torch": ("rl/",),
    "stable_baselines3": ("rl/",),
    "gymnasium": ("rl/",),
    "viser": ("scripts/viewer.py",),
}
"""Libraries and the packages that may import them; benchmarks of learning may import what `rl` does."""
RUNS_FILES = {"pickle", "_pickle", "cloudpickle", "dill", "shelve", "marshal", "joblib", "jsonpickle"}
"""Modules that run code contained in the files that they read."""
UNSAFE_YAML = {"yaml.Loader", "yaml.CLoader", "yaml.FullLoader", "yaml.CFullLoader", "yaml.full_load"}
SAFE = {"allow_pickle", "weights_only", "Loader"}
"""Keywords that state whether contents may be run."""


def sources() -> Iterator[tuple[str, ast.Module]]:
    """Name and syntax tree of each file of the product."""
    for folder in OWN:
        for path in sorted((REPOSITORY / folder).rglob("*.py")):
            if not path.name.endswith("_pb2.py"):
                yield path.relative_to(REPOSITORY).as_posix(), ast.parse(path.read_text())


def imports(tree: ast.Module) -> set[str]:
    """Full names of all modules that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module)
    return found


@pytest.fixture(scope="module")
def trees() -> dict[str, ast.Module]:
    """Syntax tree of each file of the product."""
    return dict(sources())


@pytest.fixture(scope="module")
def imported(trees) -> dict[str, set[str]]:
    """All modules that each file imports."""
    return {name: imports(tree) for name, tree in trees.items()}


@pytest.fixture(scope="module")
def libraries(imported) -> dict[str, set[str]]:
    """Libraries of others that each file imports."""
    own = set(sys.stdlib_module_names) | set(OWN)
    return {name: {one.partition(".")[0] for one in found} - own for name, found in imported.items()}


def test_imports_go_one_way(imported):
    above = {"twin/": {"rl.", "scripts."}, "rl/": {"scripts."}}
    above |= {"twin/estimation/": {"twin.physics."}, "twin/physics/": {"twin.estimation."}}
    for folder, forbidden in above.items():
        for name, found in imported.items():
            if name.startswith(folder):
                assert not [one for one in found if f"{one}.".startswith(tuple(forbidden))], name


def test_a_library_is_imported_only_in_its_package(libraries):
    for name, found in libraries.items():
        for library in found & HOME_OF.keys():
            learning = ("scripts/benchmarks/", "scripts/studies/") if "rl/" in HOME_OF[library] else ()
            assert name.startswith((*HOME_OF[library], *learning)), f"{name} imports {library}"


def dotted(node: ast.expr) -> str:
    """A name with at most one dot; empty for any other expression."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return f"{node.value.id}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def unsafe(tree: ast.Module) -> list[str]:
    """Expressions that could run code contained in a file that is read."""
    found = [module for module in imports(tree) if module.partition(".")[0] in RUNS_FILES]
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute):
            name = dotted(node)
            runs = name in {"eval", "exec", "builtins.eval", "builtins.exec", "PPO.load"}
            of_pickle = "." in name and name.split(".")[0] in RUNS_FILES
            if runs or of_pickle or name in UNSAFE_YAML or name.startswith("yaml.unsafe"):
                found.append(name)
        elif isinstance(node, ast.Call):
            called, keywords = dotted(node.func), {k.arg: k.value for k in node.keywords}
            says = {name: ast.unparse(keywords[name]) for name in SAFE & keywords.keys()}
            if (
                says.get("allow_pickle", "False") != "False"
                or (called == "torch.load") != (says.get("weights_only") == "True")
                or "Unsafe" in says.get("Loader", "")
                or (called in ("yaml.load", "yaml.load_all") and not says and len(node.args) < 2)
            ):
                found.append(ast.unparse(node))
    return found


def test_nothing_that_is_read_from_a_file_is_run(trees):
    assert not {name: unsafe(tree) for name, tree in trees.items() if unsafe(tree)}


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


def distribution(requirement: str) -> str:
    """Normalised name of a requirement such as `dask[distributed]>=2025.1`."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", requirement)[0]).lower()


def of_extra(extra: str) -> set[str]:
    """The distributions of an extra, including those of the extras that it names."""
    found = set()
    for requirement in EXTRAS[extra]:
        parts = re.findall(r"\[([\w,]+)\]", requirement)
        if requirement.startswith("endotwin["):
            found |= {one for other in parts[0].split(",") for one in of_extra(other)}
        else:
            found |= {distribution(requirement), *parts}
    return found


CORE = {distribution(requirement) for requirement in PROJECT["dependencies"]}


@pytest.fixture(scope="module")
def distributions() -> dict[str, set[str]]:
    """What each installed module belongs to."""
    held = packages_distributions()
    return {name: {distribution(one) for one in of} for name, of in held.items()}


def test_every_library_is_declared_and_every_declared_library_is_imported(libraries, distributions):
    declared = CORE | of_extra("all")
    imported = set.union(*libraries.values())
    assert not [name for name in imported if not distributions.get(name, set()) & declared]
    used = {one for name in imported for one in distributions[name]}
    assert declared - {"dask", "ffmpeg"} - used == {"onnxscript"}  # of torch's exporter


def test_extras_are_named_to_users_and_held_by_all(distributions):
    named = [(module, extra) for extra, modules in errors.EXTRAS.items() for module in modules]
    for module, extra in named:
        assert distributions[module] & of_extra(extra), f"{module} is not in the extra {extra}"
        assert not distributions[module] & CORE
    assert of_extra("all") == {one for extra in EXTRAS if extra != "dev" for one in of_extra(extra)}
    assert of_extra("dev") > of_extra("all")


def test_every_dependency_has_its_version_in_the_constraints():
    lines = (REPOSITORY / "constraints.txt").read_text().splitlines()
    held = {distribution(line) for line in lines if not line.startswith("#")}
    assert CORE | of_extra("dev") <= held | {"ffmpeg"}


def test_the_version_stands_in_the_package_and_is_cited():
    cited = re.search(r"^version: (.+)$", (REPOSITORY / "CITATION.cff").read_text(), re.MULTILINE)
    assert (PROJECT["dynamic"], cited[1]) == (["version"], twin.__version__)


@pytest.mark.parametrize("document", ["CONTRIBUTING.md", "docs/glossary.md"])
def test_every_file_that_a_document_names_exists(document):
    text = (REPOSITORY / document).read_text()
    named = set(re.findall(r"`((?:twin|rl|scripts|tests|assets|docs)/[\w./-]*)`", text))
    assert not [
        path for path in named if not re.search("VERB|NAME", path) and not Path(REPOSITORY, path).exists()
    ]
