"""The exceptions are those of EndoTwin and the built-in ones that they refine, also from another process."""

import pickle

import pytest

from twin.errors import (
    DivergedError,
    EndoTwinError,
    InputError,
    MissingExtraError,
    MissingFileError,
    missing_extra,
    require_extra,
)

KINDS = {
    InputError: ValueError,
    MissingFileError: FileNotFoundError,
    DivergedError: FloatingPointError,
    MissingExtraError: ImportError,
}


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_is_caught_by_both_names_and_keeps_its_line(kind):
    for caught in (EndoTwinError, KINDS[kind]):
        with pytest.raises(caught, match=r"^no such thing$"):
            raise kind("no such thing")
    sent = pickle.loads(pickle.dumps(kind("no such thing")))  # as from a worker process
    assert (type(sent), str(sent)) == (kind, "no such thing")


def test_a_missing_module_is_named_with_its_extra_and_a_broken_one_is_not():
    error = missing_extra(ModuleNotFoundError("No module named 'torch'", name="torch"), "this")
    assert (str(error), error.name) == ("this needs torch: pip install 'endotwin[rl]'", "torch")
    for broken in (
        ModuleNotFoundError("No module named 'numpy'", name="numpy"),
        ModuleNotFoundError("No module named 'torch.nothing'", name="torch.nothing"),
        ImportError("cannot import name 'Batch' from 'mujoco'", name="mujoco"),
    ):
        assert missing_extra(broken) is None


def test_an_extra_is_required_before_any_work(monkeypatch):
    require_extra("parquet")
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match="pip install 'endotwin\\[parquet\\]'"):
        require_extra("parquet", "the format")
