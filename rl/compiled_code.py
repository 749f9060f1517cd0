"""The folder in which torch keeps compiled code: not made, as nothing here is compiled."""

import contextlib
import os
import tempfile
from collections.abc import Iterator

_FOLDER = "TORCHINDUCTOR_CACHE_DIR"


@contextlib.contextmanager
def no_folder_of_compiled_code() -> Iterator[None]:
    """Context manager: torch leaves no folder in the temporary one.

    An optimiser alone makes one, even where nothing is ever compiled. A folder that is there already is not
    made.
    """
    before = os.environ.get(_FOLDER)
    os.environ[_FOLDER] = before or tempfile.gettempdir()
    try:
        yield
    finally:
        os.environ.pop(_FOLDER)
        if before is not None:
            os.environ[_FOLDER] = before
