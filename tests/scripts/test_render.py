"""`endotwin render` takes the ghost from another file and the reference from the record's own."""

import numpy as np
import pytest
from PIL import Image
from rendered import make_episode, needs_gl

from scripts.render import main
from twin.recording import EpisodeWriter, write_episode
from twin.recording.messages import REFERENCE_TOPIC, estimate_message, to_nanoseconds
from twin.rendering.overlay import Overlay
from twin.rendering.render import render


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Two records at the same times, the first with a reference, and one at half of them."""
    monkeypatch.chdir(tmp_path)
    episode, ghost = make_episode(), make_episode(amplitude_deg=-30)
    with EpisodeWriter("run.mcap") as writer:
        writer.write(episode)
        for k, time in enumerate(to_nanoseconds(episode.time)):
            writer.add_message(REFERENCE_TOPIC, estimate_message(float(k)), time)
    write_episode("ghost.mcap", ghost)
    write_episode("half.mcap", ghost.resampled(0.2))
    return tmp_path


@needs_gl
def test_ghost_and_reference_of_the_files_are_drawn(folder):
    assert main(["run.mcap", "--ghost", "ghost.mcap", "--out", "a.png"]) == 0
    overlay = Overlay(make_episode(), make_episode(amplitude_deg=-30), np.arange(41.0))
    wanted = np.asarray(Image.open(render(overlay, folder / "b.png")))
    drawn = np.asarray(Image.open("a.png"))
    assert np.abs(drawn.astype(int) - wanted).mean() < 0.5  # angles went through degrees


@needs_gl
@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("--ghost half.mcap --out a.png", "ghost has 21 samples from 0 to 4 s: must be at the times of"),
        ("--ghost half.mcap --out a.mp4", "ghost has 21 samples from 0 to 4 s: must be at the times of"),
        ("--ghost none.mcap --out a.png", "none.mcap"),
        ("--ghost . --out a.png", "folder"),
    ],
)
def test_a_ghost_that_cannot_be_drawn_is_one_line(folder, capsys, line, fault):
    assert main(["run.mcap", *line.split()]) == 2
    said = capsys.readouterr().err.strip()
    assert fault in said
    assert len(said.splitlines()) == 1
    assert not list(folder.glob("a.*"))
