"""The report of any result: a path is recognised by the files that it holds, and its page is written."""

import importlib
from pathlib import Path

from twin.errors import InputError, MissingFileError
from twin.report.calibration_page import FIT_END
from twin.report.page import Page
from twin.report.run_page import run_commands, run_page

KINDS: dict[str, tuple[str, str]] = {
    "gate.json": ("twin.gate.page", "read_gate_page"),
    "control.json": ("twin.report.control_page", "read_control_page"),
    "evaluation.json": ("twin.report.evaluation_page", "evaluation_page"),
    "dataset.json": ("twin.report.dataset_page", "dataset_page"),
    FIT_END: ("twin.report.calibration_page", "calibration_page"),
    "config.yaml": ("twin.report.run_page", "training_page"),
}
"""File by which each kind of result is known, and the function that makes its page."""


def write_report(path: Path, out: Path) -> Path:
    """Write the page of a run folder, or of a single result of any kind."""
    known = known_file(path)
    if known is None:
        return run_page(path).write(out)
    file, kind = known
    module, name = KINDS[kind]
    page: Page = getattr(importlib.import_module(module), name)(file)
    return page.write(out)


def known_file(path: Path) -> tuple[Path, str] | None:
    """Return the file by which a result is known, and its kind; None for a run folder."""
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
    fit = path.with_name(f"{path.stem}{FIT_END}")
    if path.suffix in (".yaml", ".yml") and fit.is_file():
        return fit, FIT_END
    for kind in KINDS:
        if path.name == kind or (kind == FIT_END and path.name.endswith(kind)):
            return path, kind
    raise InputError(
        f"{path} is no result that a report can be made of; valid: {', '.join(KINDS)}, or its folder"
    )
