"""Our own studies, outside of the wheel: `python -m scripts.studies.NAME`."""
