"""Rule for the names of files that a user chooses: the same on every system, and harmless where shown."""

from twin.errors import InputError

LONGEST_NAME = 200
"""Largest length of a name, without its ending, in bytes of UTF-8: file systems take 255 with endings."""

_RESERVED = '<>"|?*'
"""Characters that a page or a shell reads as more than a letter. Loggers put times with colons into names."""


def check_name(name: str, parameter: str = "name") -> None:
    """Refuse a name that is no plain name of a file, without folder and ending.

    Args:
        name: what the user chose.
        parameter: where, for the message.

    Raises:
        ValueError: it is empty, hidden, a path, too long, or has characters that cannot be printed or that
            some file system reserves.
    """
    if not name or name.startswith(".") or "/" in name or "\\" in name:
        raise InputError(f"{parameter} = {name!r:.40}: must be the name of a file, without folder and ending")
    if not name.isprintable() or name != name.strip():
        raise InputError(f"{parameter} = {name!r:.40}: must be printable characters, without blanks around")
    if any(character in _RESERVED for character in name):
        raise InputError(f"{parameter} = {name!r:.40}: must be without any of {' '.join(_RESERVED)}")
    if len(name.encode()) > LONGEST_NAME:
        raise InputError(f"{parameter} = {name!r:.40}: must have at most {LONGEST_NAME} bytes")
