"""The page of any run: what a path holds is recognised, and its page is written from the same parts."""

import importlib
from collections.abc import Callable
from pathlib import Path

from twin.errors import InputError, MissingFileError
from twin.report.calibration_page import FIT_END
from twin.report.parts import Page, write_page
from twin.report.run_page import run_commands, run_page

KINDS: dict[str, tuple[str, str]] = {
    "gate.json": ("twin.gate.page", "read_gate_page"),
    "control.json": ("twin.report.control_page", "read_control_page"),
    "evaluation.json": ("twin.report.evaluation_page", "evaluation_page"),
    "dataset.json": ("twin.report.dataset_page", "dataset_page"),
    FIT_END: ("twin.report.calibration_page", "calibration_page"),
    "config.yaml": ("twin.report.training_page", "training_page"),
}
"""File by which each kind of result is known, beside a whole run, and the function that makes its page."""


def write_report(path: Path, out: Path) -> Path:
    """Write the page of a run; what it lacks is named with the command that makes it.

    Args:
        path: folder of a run, a dataset, an evaluation, a training, a gate or a comparison of controllers; or
            a file by which one is known, or a calibrated preset.
        out: the HTML file to write, whole or not at all.

    Returns:
        `out`.

    Raises:
        FileNotFoundError: there is no such folder or file, or none to write into.
        ValueError: nothing there belongs to a run.
    """
    return write_page(page_of(path), out)


def page_of(path: Path) -> Page:
    """Return the page of a run; arguments and errors as in `write_report`."""
    known = known_file(path)
    if known is None:
        return run_page(path)
    file, kind = known
    module, name = KINDS[kind]
    make: Callable[[Path], Page] = getattr(importlib.import_module(module), name)
    return make(file)


def known_file(path: Path) -> tuple[Path, str] | None:
    """Return the file by which a result is known, and its kind; None for the folder of a whole run.

    Raises:
        FileNotFoundError: there is no such folder or file.
        ValueError: nothing there belongs to a run.
    """
    if path.is_file():
        return _of_file(path)
    if not path.is_dir():
        raise MissingFileError(f"no folder {path}")
    if any((path / name).exists() for name in ("demo.json", *run_commands())):
        return None
    for kind in KINDS:
        found = sorted(path.glob(f"*{kind}")) if kind == FIT_END else [path / kind]
        if len(found) > 1:
            names = ", ".join(file.name for file in found[:5])
            raise InputError(f"{path} holds {len(found)} calibrations ({names}): name one of them")
        if found and found[0].is_file():
            return found[0], kind
    valid = ", ".join((*run_commands(), *(f"NAME{kind}" if kind == FIT_END else kind for kind in KINDS)))
    raise InputError(f"{path} holds no run: expected one of {valid}")


def _of_file(path: Path) -> tuple[Path, str]:
    """Return the file by which a result is known, from that file, or from a calibrated preset beside it."""
    if path.suffix in (".yaml", ".yml") and path.with_name(f"{path.stem}{FIT_END}").is_file():
        return path.with_name(f"{path.stem}{FIT_END}"), FIT_END
    for kind in KINDS:
        if path.name == kind or (kind == FIT_END and path.name.endswith(kind)):
            return path, kind
    raise InputError(
        f"{path} is no result that a report can be made of; valid: {', '.join(KINDS)}, or its folder"
    )
