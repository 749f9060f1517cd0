"""Tests mirror what they test: a folder of tests is a package, a file of tests is named after its module."""

from repository import REPOSITORY

TESTS = REPOSITORY / "tests"


def test_each_folder_of_tests_is_a_package_of_the_product():
    packages = {path.parent.name for path in (REPOSITORY / "twin").glob("*/__init__.py")} | {"rl", "scripts"}
    folders = {path.parent.name for path in TESTS.glob("*/**/test_*.py")}
    assert folders <= packages


def test_only_tests_of_a_file_beside_the_packages_lie_beside_the_folders():
    files = {f"test_{path.stem}.py" for path in (REPOSITORY / "twin").glob("*.py")}
    assert {path.name for path in TESTS.glob("test_*.py")} <= {*files, "test_house.py"}
