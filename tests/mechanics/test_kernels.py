"""Kernels: machine code that is kept where only the user can write, and arrays that copies do not share."""

import copy
import gc
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from twin.mechanics import kernels
from twin.preset.file import load_preset
from twin.reduced import ReducedTwins

pytestmark = pytest.mark.skipif(not kernels.COMPILED, reason="nothing is compiled here")
PROGRAM = """
import numpy as np
from twin.mechanics.kernels import entry, kernel, on_compile

@kernel
def doubled(value):
    return 2.0 * value

@entry
def add(values, amount):
    for i in range(len(values)):
        values[i] += doubled(amount)

values = np.zeros(3)
with on_compile(lambda: print("compiled", end=" ")):
    add(values, 1.5)
    add(values, 1.5)
print(*values)
"""


def run(folder: Path, **environment: str) -> str:
    """Output of a program with a kernel."""
    (folder / "program.py").write_text(PROGRAM)
    kept = {name: value for name, value in os.environ.items() if name not in ("HOME", "XDG_CACHE_HOME")}
    paths = {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "program.py"]
    done = subprocess.run(
        command, cwd=folder, env=kept | paths | environment, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.fixture
def sources(tmp_path, monkeypatch):
    """A tree of sources of kernels, and a cache folder of the user."""
    for package in kernels.PACKAGES:
        (tmp_path / "twin" / package).mkdir(parents=True)
    (tmp_path / "twin" / "reduced" / "chain.py").write_text("one = 1\n")
    monkeypatch.setattr(kernels, "__file__", str(tmp_path / "twin" / "mechanics" / "kernels.py"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


def test_machine_code_is_kept_for_the_next_process(tmp_path):
    assert run(tmp_path, XDG_CACHE_HOME=str(tmp_path)) == "compiled 6.0 6.0 6.0"
    assert run(tmp_path, XDG_CACHE_HOME=str(tmp_path)) == "6.0 6.0 6.0"


@pytest.mark.parametrize("home", [{"HOME": "/proc/nowhere"}, {"HOME": "/nonexistent", "USERPROFILE": ""}])
def test_kernels_run_without_a_home_that_can_be_written(tmp_path, home):
    assert run(tmp_path, **home).endswith("6.0 6.0 6.0")


def test_a_kernel_is_compiled_once_for_all_literal_numbers():
    pair = kernels.kernel(lambda first, second: 10 * first + second)

    @kernels.entry
    def fill(values):
        for i in range(len(values)):
            values[i] = pair(i, 1) + pair(2, 3) + pair(i, i)

    values = np.zeros(3)
    fill(values)
    assert values.tolist() == [24, 45, 66]
    assert len(pair.signatures) == 1


def test_numba_compiles_other_functions_as_before():
    import numba
    from numba.core import cpu, types

    before = types.BaseFunction.get_call_type, cpu.CPUContext.load_additional_registries, gc.isenabled()

    @kernels.entry
    def wrong(values):
        values.no_such_thing()

    with pytest.raises(numba.TypingError, match="no_such_thing"):
        wrong(np.zeros(3))
    after = types.BaseFunction.get_call_type, cpu.CPUContext.load_additional_registries, gc.isenabled()
    assert after == before


def test_an_edit_of_any_kernel_leaves_no_stale_code(sources):
    before = kernels.cache_folder.__wrapped__()
    assert before == kernels.cache_folder.__wrapped__()
    (sources / "twin" / "reduced" / "chain.py").write_text("one = 2\n")
    assert kernels.cache_folder.__wrapped__() != before


def test_code_is_read_only_from_a_folder_that_no_one_else_can_write(sources, tmp_path):
    mine = kernels.cache_folder.__wrapped__()
    assert mine.is_relative_to(tmp_path / "cache")
    assert mine.stat().st_mode & 0o777 == 0o700
    mine.chmod(0o777)
    other = kernels.cache_folder.__wrapped__()
    assert other.parent == sources / "twin" / "mechanics" / "__pycache__"
    other.rmdir()
    other.symlink_to(mine)
    assert kernels.cache_folder.__wrapped__() is None
    mine.chmod(0o755)
    assert kernels.cache_folder.__wrapped__() == mine


def test_without_a_folder_code_serves_the_process(tmp_path, monkeypatch):
    monkeypatch.setattr(kernels, "cache_folder", lambda: None)

    @kernels.entry
    def double(values):
        for i in range(len(values)):
            values[i] *= 2.0

    values = np.arange(3.0)
    double(values)
    np.testing.assert_array_equal(values, [0.0, 2.0, 4.0])


def test_copy_has_arrays_of_its_own():
    twins = ReducedTwins([load_preset("ureteroscope")], 0.1)
    twins.step(1e-3)
    other = copy.deepcopy(twins)
    there = twins.bend()
    other.step(2e-3)
    np.testing.assert_array_equal(twins.bend(), there)
    np.testing.assert_array_equal(twins.step(2e-3), other.bend())


def test_kernel_within_an_entry_cannot_be_called_by_python():
    @kernels.kernel
    def double(value):
        return 2.0 * value

    with pytest.raises(TypeError, match="not callable"):
        double(1.0)
