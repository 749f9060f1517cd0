"""The viewer layout shows what an episode holds: each panel is placed once, each path leads to a number."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from twin.episode import Episode
from twin.estimation.registry import method_specs
from twin.files.assets import assets_folder
from twin.physics import simulate
from twin.preset.file import load_preset
from twin.recording import EpisodeWriter
from twin.recording.messages import estimate_message, estimate_topic, to_nanoseconds

LAYOUT = json.loads((assets_folder() / "foxglove_layout.json").read_text(encoding="utf-8"))
PANELS = LAYOUT["configById"]
PATH = re.compile(r"(?P<topic>(/[A-Za-z_]+)+)(?P<parts>(\.[a-z_]+(\[\d+\])?)+)")


@pytest.fixture(scope="module")
def episode() -> Episode:
    preset = load_preset("ureteroscope")
    return simulate(preset, 4e-3 * np.sin(np.linspace(0, np.pi, 30)), preset.control_period)


@pytest.fixture(scope="module")
def recorded(episode: Episode, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list]:
    """Every message of a simulated episode by topic, decoded by the schemas inside the file."""
    path: Path = tmp_path_factory.mktemp("layout") / "a.mcap"
    with EpisodeWriter(path) as writer:
        writer.write(episode)
        for spec in method_specs():  # as `evaluate` adds them
            for time in to_nanoseconds(episode.time):
                writer.add_message(estimate_topic(spec.name), estimate_message(1.0), time)
    result: dict[str, list] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, decoded in reader.iter_decoded_messages():
            result.setdefault(channel.topic, []).append(decoded)
    return result


def plots() -> list[dict]:
    return [config for name, config in PANELS.items() if name.startswith("Plot!")]


def message_paths() -> list[str]:
    lines = [line["value"] for plot in plots() for line in plot["paths"]]
    return lines + [plot["xAxisPath"]["value"] for plot in plots() if "xAxisPath" in plot]


def values(recorded: dict[str, list], path: str) -> list[float]:
    """What a viewer plots of a path such as `/topic.field[0]`: the number in each message.

    Raises:
        AssertionError: it is no such path, or leads to nothing that the schema knows.
    """
    match = PATH.fullmatch(path)
    assert match, path
    assert match["topic"] in recorded, path
    found = []
    for message in recorded[match["topic"]]:
        value = message
        for name, index in re.findall(r"\.([a-z_]+)(?:\[(\d+)\])?", match["parts"]):
            field = value.DESCRIPTOR.fields_by_name.get(name)
            assert field is not None, path
            assert not field.has_presence or value.HasField(name), path
            value = getattr(value, name)
            if index:
                assert int(index) < len(value), path
                value = value[int(index)]
        assert isinstance(value, float), path
        found.append(value)
    return found


@pytest.mark.parametrize("path", sorted(set(message_paths())))
def test_plotted_path_leads_to_a_number_in_every_message(recorded, path):
    assert len(values(recorded, path)) == 30


def test_curves_show_what_they_are_named_after(recorded, episode):
    """The hidden state of wire a: at the pulley and at the tip, which are the first and last length."""
    shown = {line["label"]: values(recorded, line["value"]) for line in PANELS["Plot!hidden"]["paths"]}
    np.testing.assert_array_equal(shown["tension at the pulley"], episode.wire_tension[:, 0, 0])
    np.testing.assert_array_equal(shown["tension at the tip"], episode.wire_tension[:, 0, -1])
    np.testing.assert_array_equal(shown["friction, 1st element"], episode.sheath_friction[:, 0, 0])
