"""A state is numbers under our mark: what was written comes back, and nothing else is accepted or touched."""

import os

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of
from pickles import planted_pickle, planted_zip

from twin.files.state_file import read_state, remove_state, state_key, write_state

KIND, KEY = "kind of state", state_key("this run")
numbers = arrays_of.arrays(
    np.float64,
    arrays_of.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
    elements=st.floats(allow_nan=False, allow_infinity=False),
)
again = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


@again
@given(arrays=st.dictionaries(st.text(max_size=8), numbers, max_size=4))
def test_what_was_written_comes_back_bit_for_bit(tmp_path, arrays):
    path = tmp_path / "state"
    write_state(path, KIND, KEY, arrays)
    found = read_state(path, KIND, KEY)
    assert found is not None
    assert list(found) == list(arrays)
    assert all(found[name].tobytes() == arrays[name].tobytes() for name in arrays)
    assert all(found[name].shape == arrays[name].shape for name in arrays)
    assert read_state(path, KIND, state_key("another run")) is None
    remove_state(path, KIND)
    assert read_state(path, KIND, KEY) is None


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "state"
    write_state(path, KIND, KEY, {"costs": np.arange(6.0).reshape(2, 3)})
    return path


@again
@given(where=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_is_refused_or_changes_no_number(tmp_path, where, bit):
    path = tmp_path / "state"
    write_state(path, KIND, KEY, {"costs": np.arange(6.0).reshape(2, 3)})
    content = bytearray(path.read_bytes())
    content[int(where * len(content))] ^= 1 << bit
    path.write_bytes(content)
    try:
        found = read_state(path, KIND, KEY)
    except ValueError:
        found = None
    assert found is None or found["costs"].tolist() == [[0, 1, 2], [3, 4, 5]]
    assert path.read_bytes() == content


def test_truncated_or_infinite_state_is_refused(written):
    whole = written.read_bytes()
    for size in range(0, len(whole), 7):
        written.write_bytes(whole[:size])
        with pytest.raises(ValueError, match="is damaged"):
            read_state(written, KIND, KEY)
    for value in (np.nan, -np.inf):
        written.unlink()
        write_state(written, KIND, KEY, {"costs": np.array([1.0, value])})
        with pytest.raises(ValueError, match="is damaged"):
            read_state(written, KIND, KEY)


@pytest.mark.parametrize("planted", [planted_pickle, planted_zip, lambda path: b"my notes", lambda path: b""])
def test_foreign_file_is_neither_executed_nor_touched(tmp_path, planted):
    path, witness = tmp_path / "state", tmp_path / "it ran"
    path.write_bytes(planted(witness))
    before = path.read_bytes()
    for act in (lambda: read_state(path, KIND, KEY), lambda: remove_state(path, KIND)):
        with pytest.raises(ValueError, match="is no kind of state of EndoTwin"):
            act()
    assert path.read_bytes() == before
    assert not witness.exists()


def test_link_folder_and_pipe_are_neither_followed_nor_removed(written, tmp_path):
    link, folder, pipe = (tmp_path / name for name in ("link", "folder", "pipe"))
    link.symlink_to(written)
    folder.mkdir()
    os.mkfifo(pipe)
    for path in (link, folder, pipe):
        for act in (
            lambda path=path: read_state(path, KIND, KEY),
            lambda path=path: remove_state(path, KIND),
        ):
            with pytest.raises(ValueError, match=r"is a link|is a folder|is no file"):
                act()
        assert os.path.lexists(path)


def test_different_inputs_have_different_keys():
    keys = {
        state_key(*inputs)
        for inputs in (
            ("a", "b"), ("ab",), ("a",), (b"ab",), (1,), ([1, 2],), (np.zeros(2),), (np.zeros((2, 1)),),
            (np.zeros(4, dtype=np.float32),), (np.ones(2),),
        )
    }  # fmt: skip
    assert len(keys) == 10
