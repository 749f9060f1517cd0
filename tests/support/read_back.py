"""Outputs read back by their readers: what a run that says that it succeeded has written."""

import csv
import html.parser
import json
import sys
from collections.abc import Callable
from pathlib import Path

MOST_BYTES = 200_000_000


def print_faults(root: str, names: list[str]) -> int:
    """Print one JSON object of the files that do not read back; runs in a process of its own."""
    found = {}
    for name in names:
        path = Path(root, name)
        try:
            check(path)
        except BaseException as error:
            found[name] = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
    sys.stdout.write(json.dumps(found))
    return 0


def check(path: Path) -> None:
    """Raise an error if a file is not what its ending says."""
    assert path.stat().st_size < MOST_BYTES, "is huge"
    reader = READERS.get(path.suffix)
    if reader is not None:
        reader(path)


def no_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def no_key_twice(pairs: list) -> dict:
    keys = [key for key, _ in pairs]
    assert len({*keys}) == len(keys), "a key stands twice"
    return dict(pairs)


def read_json(path: Path) -> None:
    json.loads(path.read_text(), parse_constant=no_constant, object_pairs_hook=no_key_twice)
    if path.name == "dataset.json":
        check_index(path)


def check_index(path: Path) -> None:
    from twin.dataset.verify import verify

    faults, _ = verify(path.parent)
    assert not faults, faults[0]


def read_yaml(path: Path) -> None:
    import yaml

    assert yaml.safe_load(path.read_text()) is not None


def read_table(path: Path) -> None:
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows, "is empty"
    assert {len(row) for row in rows} == {len(rows[0])}, "rows of several lengths"


def read_mcap(path: Path) -> None:
    from twin.recording import read_episode

    read_episode(path)


def read_picture(path: Path) -> None:
    from PIL import Image

    with Image.open(path) as picture:
        picture.load()


def read_film(path: Path) -> None:
    import av

    with av.open(str(path)) as film:
        assert sum(frame.width > 0 for frame in film.decode(video=0)) > 0, "has no frame"


def read_network(path: Path) -> None:
    import onnx

    model = onnx.load(path)
    onnx.checker.check_model(model)
    assert model.metadata_props, "has no metadata"


def read_arrays(path: Path) -> None:
    import numpy as np

    with np.load(path, allow_pickle=False) as arrays:
        assert [arrays[name] for name in arrays.files], "holds nothing"


def read_columns(path: Path) -> None:
    import pyarrow.parquet

    assert pyarrow.parquet.read_table(path).num_rows > 0


PLAYER = (Path(__file__).resolve().parents[2] / "assets/player.js").read_text().strip()
"""Script of the slider over a record, which a page may hold."""


class Page(html.parser.HTMLParser):
    """Refuses a script, or a handler, that came with the name of a file: the slider's is the only one."""

    script = inert = False

    def handle_starttag(self, tag: str, attributes: list) -> None:
        self.script, self.inert = tag == "script", ("type", "application/json") in attributes
        for name, value in attributes:
            assert not name.startswith("on"), f"holds a handler {name}"
            assert not (value or "").startswith("javascript:"), "holds a link that is a script"

    def handle_data(self, data: str) -> None:
        if self.script and not self.inert:
            assert data.strip() == PLAYER, "holds a script"
        elif self.script:
            json.loads(data)
        self.script = False


def read_page(path: Path) -> None:
    text = path.read_text()
    assert text.rstrip().endswith("</html>"), "does not end as a page"
    Page().feed(text)


def read_text(path: Path) -> None:
    text = path.read_text()
    assert text, "is empty"
    assert not any(ord(letter) < 32 and letter not in "\n\t" for letter in text), "holds control characters"
    assert "<script" not in text, "holds a script"


READERS: dict[str, Callable[[Path], None]] = {
    ".json": read_json,
    ".yaml": read_yaml,
    ".csv": read_table,
    ".mcap": read_mcap,
    ".png": read_picture,
    ".mp4": read_film,
    ".onnx": read_network,
    ".npz": read_arrays,
    ".parquet": read_columns,
    ".html": read_page,
    ".md": read_text,
}
