"""Tests mirror what they test: each folder of tests is a package of the product."""

from repository import REPOSITORY


def test_each_folder_of_tests_is_a_package_of_the_product():
    packages = {path.parent.name for path in (REPOSITORY / "twin").glob("*/__init__.py")} | {"rl", "scripts"}
    folders = {path.parent.name for path in (REPOSITORY / "tests").glob("*/**/test_*.py")}
    assert folders <= packages
