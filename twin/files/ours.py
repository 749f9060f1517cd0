"""Signs of what EndoTwin wrote: a command replaces a file that bears the sign of its kind, and no other."""

from pathlib import Path

from twin.errors import InputError
from twin.files.atomic import refuse_no_file

MADE_BY = "made by endotwin"
"""Sign in pictures, films, pages and tables. JSON files are known by their keys."""

_END = 65536  # bytes at either end of a file in which its sign is sought


def refuse_foreign(path: Path, sign: str = MADE_BY) -> None:
    """Refuse to replace a file that does not bear a sign: it is the user's, or of another command.

    A file without any content is nobody's.

    Raises:
        ValueError: there is such a file, a link, a folder or a device of that name.
        OSError: what is there cannot be read.
    """
    refuse_no_file(path)
    if not path.exists():
        return
    size = path.stat().st_size
    with path.open("rb") as file:
        ends = file.read(_END)
        file.seek(max(size - _END, 0))
        ends += file.read(_END)
    if size and sign.encode() not in ends:
        raise InputError(f"{path} is there and no such command made it: move it, or choose another name")
