"""What is imported is declared, where it is needed; the version stands once."""

import ast
import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import twin
from twin.errors import EXTRA_OF

REPOSITORY = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
OWN = {"twin", "rl", "scripts"}
CORE = (
    "twin/errors.py",
    "twin/episode.py",
    "twin/estimation",
    "twin/evaluation",
    "twin/files",
    "twin/hysteresis",
    "twin/measured",
    "twin/preset",
    "twin/recording",
    "twin/runtime",
    "twin/signals",
    "twin/stream",
    "twin/workers",
)
"""What works with the core alone."""


def distribution(requirement: str) -> str:
    """The name of a requirement, as in `dask[distributed]>=2025.1`, normalised."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", requirement)[0]).lower()


def of_extra(extra: str) -> set[str]:
    """The distributions of an extra, those of the extras that it names included."""
    found = set()
    for requirement in EXTRAS[extra]:
        if requirement.startswith("endotwin["):
            for other in requirement[len("endotwin[") : -1].split(","):
                found |= of_extra(other)
        else:
            found |= {distribution(requirement)}
            found |= {distribution(part) for part in re.findall(r"\[(\w+)\]", requirement)}
    return found


CORE_DISTRIBUTIONS = {distribution(requirement) for requirement in PROJECT["dependencies"]}
DISTRIBUTIONS = {name: {distribution(one) for one in held} for name, held in packages_distributions().items()}


def imports(path: Path, *, top_level: bool = False) -> set[str]:
    """Top-level names of the modules of others that a file imports, anywhere or at its top."""
    tree = ast.parse(path.read_text())
    nodes = ast.walk(tree)
    if top_level:
        nodes = (node for node in tree.body if not _is_type_checking(node))
    names = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names |= {node.module.partition(".")[0]}
    return names - set(sys.stdlib_module_names) - OWN


def _is_type_checking(node: ast.stmt) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def files(*places: str) -> list[Path]:
    found = []
    for place in places:
        path = REPOSITORY / place
        found += sorted(path.rglob("*.py")) if path.is_dir() else [path]
    return found


@pytest.mark.parametrize("package", sorted(OWN))
def test_everything_imported_is_declared(package):
    declared = CORE_DISTRIBUTIONS | of_extra("all")
    for path in files(package):
        for name in imports(path):
            assert DISTRIBUTIONS.get(name, set()) & declared, f"{path}: {name} is not in pyproject.toml"


@pytest.mark.parametrize("place", CORE)
def test_the_core_imports_no_extra(place):
    for path in files(place):
        for name in imports(path, top_level=True):
            assert name not in EXTRA_OF, f"{path} imports {name}, which endotwin[{EXTRA_OF[name]}] installs"
            assert DISTRIBUTIONS[name] & CORE_DISTRIBUTIONS, f"{path}: {name} is not of the core"


def test_no_module_of_the_core_brings_an_extra_with_it():
    """Nor does anything of ours that they import."""
    modules = [
        ".".join(path.relative_to(REPOSITORY).with_suffix("").parts).removesuffix(".__init__")
        for path in files(*CORE)
    ]
    code = f"import importlib, sys\nfor name in {modules}: importlib.import_module(name)\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    imported = set(done.stdout.split())
    assert set(modules) <= imported
    assert imported & set(EXTRA_OF) == set()


def test_modules_of_extras_are_told_with_the_extra_that_declares_them():
    for module, extra in EXTRA_OF.items():
        assert DISTRIBUTIONS[module] & of_extra(extra), f"{module} is not in the extra {extra}"
        assert not DISTRIBUTIONS[module] & CORE_DISTRIBUTIONS
    imported = {name for package in OWN for path in files(package) for name in imports(path)}
    extras = {name for name in imported if not DISTRIBUTIONS[name] & CORE_DISTRIBUTIONS}
    assert extras | {"onnxscript"} == set(EXTRA_OF)  # torch's exporter imports it


def test_everything_declared_is_imported():
    imported = {name for package in OWN for path in files(package) for name in imports(path)}
    used = {one for name in imported for one in DISTRIBUTIONS[name]}
    declared = (CORE_DISTRIBUTIONS | of_extra("all")) - {"dask", "ffmpeg"}
    assert declared - used == {"onnxscript"}  # torch's exporter imports it


def test_all_and_dev_hold_every_extra():
    everything = {one for extra in EXTRAS if extra != "dev" for one in of_extra(extra)}
    assert of_extra("all") == everything
    assert of_extra("dev") > everything


def test_every_dependency_has_its_version_in_the_constraints():
    lines = (REPOSITORY / "constraints.txt").read_text().splitlines()
    held = {distribution(line) for line in lines if not line.startswith("#")}
    assert CORE_DISTRIBUTIONS | of_extra("dev") <= held | {"ffmpeg"}
    assert lines[2:] == sorted(lines[2:], key=lambda line: line.partition("==")[0].lower())


def test_the_version_stands_in_the_package_and_is_cited():
    assert PROJECT["dynamic"] == ["version"]
    assert "version" not in PROJECT
    cited = re.search(r"^version: (.+)$", (REPOSITORY / "CITATION.cff").read_text(), re.MULTILINE)
    assert cited[1] == twin.__version__


@pytest.mark.parametrize("package", ["twin", "rl"])
def test_the_packages_say_that_they_are_typed(package):
    assert (REPOSITORY / package / "py.typed").is_file()
