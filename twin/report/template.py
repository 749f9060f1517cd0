"""Templates of HTML pages, which escape all that is shown and refuse a name that nobody gave."""

import jinja2

from twin.files.assets import assets_folder


def page_environment() -> jinja2.Environment:
    """Return the environment of the templates in `assets`."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(assets_folder()),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
