"""Kernels as machine code: made once, kept, loaded without Numba, and the same as Python."""

import copy
import subprocess
import sys
import threading
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.mechanics import compiled, machine_code
from twin.mechanics.compiled import COMPILED, PackedArgument, bound, entry, inlined
from twin.preset.file import load_preset
from twin.reduced import ReducedTwins

pytestmark = pytest.mark.skipif(not COMPILED, reason="nothing is compiled here")


class Inner(NamedTuple):
    values: np.ndarray
    factor: float


class Mixed(NamedTuple):
    inner: Inner
    count: int
    rows: np.ndarray
    signs: np.ndarray
    missing: None
    on: bool


@inlined
def _doubled(value):
    return 2.0 * value


@compiled.compiled
def _branch(missing, value):
    if missing is None:
        return value
    return value + missing.nothing_of_this_kind


@entry
def mix(mixed, wide, flags, power, out):
    """Write sums of all kinds of arguments."""
    total = 0.0
    for value in mixed.inner.values:
        total += _doubled(value) * mixed.inner.factor
    for i in range(mixed.rows.shape[0]):
        for j in range(mixed.rows.shape[1]):
            total += mixed.rows[i, j] * (i + 10 * j)
    for i in range(len(mixed.signs)):
        total += mixed.signs[i] * (1 if flags[i] else 3)
    for i in range(wide.shape[0]):
        for j in range(wide.shape[1]):
            out[1 + j] += wide[i, j] * mixed.count
    out[0] = _branch(mixed.missing, total) ** power + (1.0 if mixed.on else 0.0)


@entry
def add(values, amount):
    """Add to each number of an array."""
    for i in range(len(values)):
        values[i] += amount


NUMBERS = st.floats(-1e3, 1e3)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder for machine code; entries of this file have none in memory."""
    monkeypatch.setattr(machine_code, "cache_folder", lambda: tmp_path)
    for one in (mix, add):
        monkeypatch.setattr(one, "_functions", {})
    return tmp_path


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 5), st.integers(1, 4), st.booleans(), NUMBERS, st.integers(0, 2**32))
def test_arguments_of_all_kinds_mean_what_they_mean_in_python(count, columns, on, factor, seed):
    rng = np.random.default_rng(seed)
    whole = rng.normal(size=(count + 2, columns + 3))
    signs = rng.integers(-1, 2, count).astype(np.int8)
    mixed = Mixed(Inner(rng.normal(size=count), factor), count - 2, rng.normal(size=(2, 3)), signs, None, on)
    arguments = mixed, whole[1:, 2:-1], rng.random(count) < 0.5, 2
    expected, found = np.zeros((2, 1 + columns))
    mix.kernel(*arguments, expected)
    mix(*arguments, found)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_what_is_kept_is_loaded_and_what_is_damaged_is_made_anew(folder, monkeypatch):
    values = np.arange(4.0)
    add(values, 1.0)
    (path,) = folder.glob("*.bin")
    kept = path.read_bytes()

    made = []
    whole = machine_code._make
    monkeypatch.setattr(machine_code, "_make", lambda *given: made.append(given) or whole(*given))
    for damage in (b"", kept[:-1], kept[:60] + b"\0" + kept[61:], b"machine code 0\n" + kept[15:]):
        path.write_bytes(damage)
        monkeypatch.setattr(add, "_functions", {})
        add(values, 1.0)
        assert machine_code._read(path) is not None
    assert len(made) == 4
    monkeypatch.setattr(add, "_functions", {})
    add(values, 1.0)
    assert len(made) == 4  # it was loaded
    np.testing.assert_array_equal(values, np.arange(4.0) + 6)


def test_code_of_other_kinds_of_arguments_is_kept_beside_it(folder):
    add(np.arange(4.0), 1.0)
    add(np.arange(8.0)[::2], 1.0)
    add(np.arange(4), 1)
    assert len(list(folder.glob("*.add-*.bin"))) == 3


def test_where_nothing_can_be_written_the_code_serves_the_process(folder, monkeypatch):
    monkeypatch.setattr(machine_code, "cache_folder", lambda: folder / "file" / "none")
    (folder / "file").write_text("no folder")
    values = np.zeros(2)
    add(values, 1.0)
    np.testing.assert_array_equal(values, 1.0)


def test_what_no_kernel_takes_is_refused():
    with pytest.raises(TypeError, match="not str"):
        add(np.zeros(2), "more")


def test_kernel_that_makes_an_array_is_refused(folder):
    @entry
    def makes_an_array(values):
        values[0] = np.zeros(3).sum()

    with pytest.raises(Exception, match="zeros"):
        makes_an_array(np.zeros(1))


def test_bound_arguments_are_those_of_later_calls():
    values = np.zeros(3)
    more = bound(add, values)
    more(1.0)
    values[0] = 5.0
    more(2.0)
    np.testing.assert_array_equal(values, [7.0, 3.0, 3.0])
    all_of_it = bound(add, values, 1.0)
    all_of_it()
    all_of_it()
    np.testing.assert_array_equal(values, [9.0, 5.0, 5.0])
    interpreted = bound(add.kernel, values)
    interpreted(1.0)
    np.testing.assert_array_equal(values, [10.0, 6.0, 6.0])


def test_copy_has_arrays_of_its_own():
    twins = ReducedTwins([load_preset("ureteroscope")], 0.1)
    twins.step(1e-3)
    other = copy.deepcopy(twins)
    there = twins.bend()
    other.step(2e-3)
    np.testing.assert_array_equal(twins.bend(), there)
    np.testing.assert_array_equal(twins.step(2e-3), other.bend())


def test_threads_that_begin_together_share_one_making(folder, monkeypatch):
    made = []
    whole = machine_code._make
    monkeypatch.setattr(machine_code, "_make", lambda *given: made.append(given) or whole(*given))
    rows = np.zeros((6, 1000))
    threads = [threading.Thread(target=add, args=(row, 1.0)) for row in rows]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(rows, 1.0)
    assert len(made) == 1


def test_words_are_numbers_addresses_lengths_and_strides():
    values = np.arange(6.0).reshape(2, 3)
    packed = PackedArgument((values, 7, None, 0.5, True))
    assert packed.layout == "(d2Cinfb)"
    expected = [values.ctypes.data, 2, 3, 24, 8, 7, np.float64(0.5).view(np.int64), 1]
    assert np.frombuffer(packed.words, np.int64).tolist() == expected
    assert PackedArgument(values.T).layout == "d2A"


def test_a_start_with_kept_code_loads_no_numba():
    preset = load_preset("ureteroscope")
    ReducedTwins([preset], 0.1).step(1e-3)  # kept from here on
    code = (
        "import sys\nfrom twin.preset.file import load_preset\nfrom twin.reduced import ReducedTwins\n"
        "print(ReducedTwins([load_preset('ureteroscope')], 0.1).step(1e-3)[0].hex(), 'numba' in sys.modules)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    bend = ReducedTwins([preset], 0.1).step(1e-3)[0]
    assert told.split() == [float(bend).hex(), "False"]
