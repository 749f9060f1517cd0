"""The viewer layout shows what an episode holds: each panel is placed once, each path leads to a number."""

import json
import re
from collections.abc import Iterator
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
from twin.recording.camera import CAMERA_TOPIC
from twin.recording.estimate import estimate_message, estimate_topic
from twin.recording.messages import to_nanoseconds
from twin.recording.scene import scene

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


def placed(node: dict | str) -> Iterator[str]:
    """Yield the panels of the mosaic, a binary tree of splits."""
    if isinstance(node, str):
        yield node
        return
    assert set(node) == {"direction", "first", "second", "splitPercentage"}
    assert node["direction"] in ("row", "column")
    assert 0 < node["splitPercentage"] < 100
    yield from placed(node["first"])
    yield from placed(node["second"])


def test_layout_is_of_the_form_that_viewers_import():
    assert set(LAYOUT) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}


def test_every_panel_is_placed_once_and_has_its_settings():
    panels = list(placed(LAYOUT["layout"]))
    assert len(panels) == len(set(panels))
    assert set(panels) == set(PANELS)
    assert {name.partition("!")[0] for name in panels} == {"3D", "Image", "Plot"}


def test_every_panel_has_its_title_in_both_viewers():
    titles = [config["foxglovePanelTitle"] for config in PANELS.values()]
    assert [config["lichtblickPanelTitle"] for config in PANELS.values()] == titles
    assert len(set(titles)) == len(titles)


@pytest.mark.parametrize("path", sorted(set(message_paths())))
def test_plotted_path_leads_to_a_number_in_every_message(recorded, path):
    assert len(values(recorded, path)) == 30


def test_curves_show_what_they_are_named_after(recorded, episode):
    """The hidden state of wire a: at the pulley and at the tip, which are the first and last length."""
    shown = {line["label"]: values(recorded, line["value"]) for line in PANELS["Plot!hidden"]["paths"]}
    np.testing.assert_array_equal(shown["tension at the pulley"], episode.wire_tension[:, 0, 0])
    np.testing.assert_array_equal(shown["tension at the tip"], episode.wire_tension[:, 0, -1])
    np.testing.assert_array_equal(shown["friction, 1st element"], episode.sheath_friction[:, 0, 0])


def test_hysteresis_is_plotted_over_the_command(recorded, episode):
    """Pairs by their order: both topics need a message at every sample."""
    (loop,) = [plot for plot in plots() if plot["xAxisVal"] != "timestamp"]
    assert loop["xAxisVal"] == "custom"
    assert loop["xAxisPath"] == {"value": "/command.pull_mm", "enabled": True}
    (line,) = loop["paths"]
    np.testing.assert_array_equal(values(recorded, loop["xAxisPath"]["value"]), episode.pull_mm)
    np.testing.assert_array_equal(values(recorded, line["value"]), episode.truth_deg)


def test_every_curve_is_enabled_and_told_apart():
    for plot in plots():
        assert all(line["enabled"] for line in plot["paths"])
        assert len({line["color"] for line in plot["paths"]}) == len(plot["paths"])
        assert len({line["label"] for line in plot["paths"]}) == len(plot["paths"])


def test_shown_topics_are_those_of_an_episode(recorded):
    (view,) = [config for name, config in PANELS.items() if name.startswith("3D!")]
    (image,) = [config for name, config in PANELS.items() if name.startswith("Image!")]
    assert set(view["topics"]) == {"/scene", "/tf"} <= set(recorded)
    assert all(topic["visible"] for topic in view["topics"].values())
    assert image["imageMode"]["imageTopic"] == CAMERA_TOPIC


def test_camera_sees_the_whole_scene_from_beside_the_bending_plane(episode):
    """Distance and clipping planes are those of an instrument of centimetres, not of a car."""
    (view,) = [config for name, config in PANELS.items() if name.startswith("3D!")]
    camera = view["cameraState"]
    drawn = scene(episode, 0)
    assert view["followTf"] in {entity.frame_id for entity in drawn.entities}
    polar, azimuth = np.radians([camera["phi"], camera["thetaOffset"]])
    # The viewer's convention: from the target back to the eye; z is up, and zero azimuth looks along +y.
    backwards = np.array([-np.sin(polar) * np.sin(azimuth), -np.sin(polar) * np.cos(azimuth), np.cos(polar)])
    eye = np.array(camera["targetOffset"]) + camera["distance"] * backwards
    assert eye[1] < 0
    assert abs(backwards[1]) > 0.9  # nearly square to the x-z plane, in which it bends
    section = episode.metadata["preset"]["section_length"]
    arc = np.linspace(0, section, 50)
    for bend in np.radians([-90, 0, 90]):
        angle = np.linspace(0, bend, 50)
        step = section / 49
        tip = np.stack([np.cumsum(np.cos(angle)), np.zeros(50), np.cumsum(np.sin(angle))], axis=1) * step
        sheath = np.stack([-arc / 2, np.zeros(50), np.zeros(50)], axis=1)
        ways = np.concatenate([tip, sheath]) - eye
        depth = -ways @ backwards
        assert (depth > 5 * camera["near"]).all()
        assert (depth < camera["far"]).all()
        across = np.linalg.norm(ways + depth[:, None] * backwards, axis=1)
        assert (np.degrees(np.arctan2(across, depth)) < camera["fovy"] / 2).all()
        assert np.degrees(np.arctan2(across, depth)).max() > camera["fovy"] / 4
