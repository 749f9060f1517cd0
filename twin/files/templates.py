"""Templates of cards in Markdown, which refuse a name that nobody gave."""

from typing import TYPE_CHECKING

from twin.files.assets import assets_folder

if TYPE_CHECKING:
    import jinja2


def card_environment() -> "jinja2.Environment":
    """Return the environment of the cards' templates in `assets`."""
    import jinja2  # of an extra: files are read without it

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(assets_folder()),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
