"""Location of `assets/`: beside the packages in a checkout, inside `twin` once installed."""

from pathlib import Path


def assets_folder() -> Path:
    """Return the folder that holds the scene and the presets."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "assets"
    return installed if installed.is_dir() else package.parent / "assets"
