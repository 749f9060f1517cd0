"""Exporting damaged files: refused, or the complete part of them is kept and the rest is reported."""

import json
from pathlib import Path

import numpy as np
import pytest
from exporting import make_records, run
from mcap.reader import make_reader
from recorded import make_episode

from twin.recording import write_episode

pq = pytest.importorskip("pyarrow.parquet")


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return make_records(tmp_path / "data")


@pytest.fixture
def damaged(data: Path) -> Path:
    """The same, and a file of which a chunk in the middle is lost, and one of which nothing is left."""
    long = make_episode(6000, seed=9, drive=True)
    path = write_episode(data / "long.mcap", long)
    content = bytearray(path.read_bytes())
    with path.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    inside = chunks[len(chunks) // 2].chunk_start_offset + 1000
    content[inside : inside + 64] = bytes(64)
    path.write_bytes(content)
    (data / "none.mcap").write_bytes(content[:100])
    return data


def test_a_damaged_file_is_refused_and_nothing_is_left_behind(damaged, tmp_path, capsys):
    for form in ("parquet", "mcap"):
        code, out, err = run(capsys, damaged, "--out", tmp_path / "le", "--format", form)
        assert (code, out) == (2, "")
        assert err.startswith(f"endotwin export: {damaged / 'long.mcap'} is damaged")
        assert len(err.splitlines()) == 1
        assert sorted(path.name for path in tmp_path.iterdir()) == ["data"]


def test_what_is_whole_of_damaged_files_is_exported_without_making_anything_up(damaged, tmp_path, capsys):
    code, out, err = run(capsys, damaged, "--out", tmp_path / "le", "--recover", "--json")
    assert code == 0
    summary = json.loads(out)
    (recovered,) = summary["recovered"]
    assert recovered["file"] == str(damaged / "long.mcap")
    assert 0 < recovered["samples"] < 6000
    assert [Path(lost["file"]).name for lost in summary["lost"]] == ["none.mcap"]
    first, second = err.splitlines()
    assert first.startswith(f"endotwin export: {damaged / 'long.mcap'}: {recovered['samples']:,} ")
    assert str(damaged / "none.mcap") in second
    rows = pq.read_table(tmp_path / "le" / "meta" / "episodes").to_pylist()
    assert [row["source"] for row in rows[3:]] == ["long"]
    full = make_episode(6000, seed=9, drive=True)
    bend = pq.read_table(tmp_path / "le" / "data")["truth.bend_deg"].to_numpy()
    piece = bend[rows[3]["dataset_from_index"] : rows[3]["dataset_to_index"]]
    np.testing.assert_allclose(piece, np.degrees(full.bend[: recovered["samples"]]), rtol=1e-12)
