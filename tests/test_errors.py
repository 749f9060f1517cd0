"""The exceptions are those of EndoTwin and the built-in ones that they refine, also from another process."""

import errno
import pickle

import pytest

from twin.errors import (
    EXTRA_OF,
    DivergedError,
    EndoTwinError,
    InputError,
    MissingExtraError,
    MissingFileError,
    missing_extra,
    require_extra,
)


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [
        (InputError, ValueError),
        (MissingFileError, FileNotFoundError),
        (DivergedError, FloatingPointError),
        (MissingExtraError, ImportError),
    ],
)
def test_each_kind_is_caught_by_both_names_and_keeps_its_line(kind, builtin):
    for caught in (EndoTwinError, builtin):
        with pytest.raises(caught, match=r"^no such thing$"):
            raise kind("no such thing")
    sent = pickle.loads(pickle.dumps(kind("no such thing")))  # as from a worker process
    assert (type(sent), str(sent)) == (kind, "no such thing")


def test_a_missing_file_may_have_a_number_and_a_name_as_of_the_system():
    error = MissingFileError(errno.ENOENT, "No such file or directory", "a.mcap")
    assert (error.errno, error.filename) == (errno.ENOENT, "a.mcap")


@pytest.mark.parametrize("module", EXTRA_OF)
def test_a_missing_module_of_an_extra_is_told_with_the_extra(module):
    error = missing_extra(ModuleNotFoundError(f"No module named {module!r}", name=module), "this")
    assert str(error) == f"this needs {module}: pip install 'endotwin[{EXTRA_OF[module]}]'"
    assert error.name == module


@pytest.mark.parametrize(
    "error",
    [
        ModuleNotFoundError("No module named 'numpy'", name="numpy"),
        ModuleNotFoundError("No module named 'torch.nothing'", name="torch.nothing"),  # it is there, and old
        ImportError("cannot import name 'Batch' from 'mujoco'", name="mujoco"),
    ],
)
def test_a_broken_installation_is_not_taken_for_a_missing_extra(error):
    assert missing_extra(error) is None


def test_an_extra_is_required_before_any_work(monkeypatch):
    require_extra("parquet")
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(
        MissingExtraError, match=r"^the format needs pyarrow: pip install 'endotwin\[parquet\]'$"
    ):
        require_extra("parquet", "the format")
    require_extra("sim")
