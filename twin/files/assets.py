"""Location of `assets/`, and the templates of cards in it."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import jinja2


def assets_folder() -> Path:
    """Return the folder of scene, presets and templates: in the checkout, or inside `twin` once installed."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "assets"
    return installed if installed.is_dir() else package.parent / "assets"


def card_environment() -> "jinja2.Environment":
    """Return the environment of the templates of cards in Markdown, which refuse an undefined name."""
    import jinja2  # of an extra: files are read without it

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(assets_folder()),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
