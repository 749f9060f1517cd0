"""Marks of what EndoTwin wrote: a command replaces a file that carries the mark of its kind, and no other."""

from pathlib import Path

from twin.errors import InputError
from twin.files.atomic import refuse_no_file

MADE_BY = "made by endotwin"
"""Mark in the comments or metadata of whatever a command writes; JSON has it under `made_by`."""

_END = 65536  # bytes at either end of a file in which its mark is sought


def made_by(what: str) -> str:
    """Return the mark of a kind of file, such as that of a model or of an evaluation."""
    return f"{MADE_BY} {what}"


def refuse_foreign(path: Path, mark: str = MADE_BY) -> None:
    """Refuse to replace a file that does not carry a mark: it is the user's, or of another command.

    A file without any content is nobody's.

    Raises:
        ValueError: there is such a file, a link, a folder or a device of that name.
        OSError: what is there cannot be read.
    """
    refuse_no_file(path)
    if not path.exists():
        return
    with path.open("rb") as file:
        ends = file.read(_END)
        size = path.stat().st_size
        if size > 2 * _END:
            file.seek(-_END, 2)
        ends += file.read(_END)
    if size and mark.encode() not in ends:
        raise InputError(f"{path} is there, but not as `{mark}`: choose another name, or move it away")
