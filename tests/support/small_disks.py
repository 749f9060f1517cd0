"""A file system in memory of a given size, which fills up."""

import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[[int], Path]]:
    """Mount a file system in memory, or change the size of the one mounted before."""
    disk = tmp_path / "disk"
    mounted = False

    def mount(kilobytes: int) -> Path:
        nonlocal mounted
        disk.mkdir(exist_ok=True)
        how = f"remount,size={kilobytes}k" if mounted else f"size={kilobytes}k"
        result = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", how, "tmpfs", str(disk)], capture_output=True, text=True
        )
        if result.returncode:
            pytest.skip(f"cannot mount a file system here: {result.stderr.strip()}")
        mounted = True
        return disk

    yield mount
    if mounted:
        subprocess.run(["umount", "--lazy", str(disk)], check=True)
