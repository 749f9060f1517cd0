"""The viewer layout of a live stream: each panel is placed once, each path leads to what is recorded."""

import json
import re

import pytest
from live_streams import ESTIMATE, Sample, good_samples, record
from recorded import messages

from twin.files.assets import assets_folder
from twin.live.reading import Alarm, Health, Reading, Source
from twin.recording.estimate import estimate_topic

LAYOUT = json.loads((assets_folder() / "foxglove_live_layout.json").read_text(encoding="utf-8"))
PANELS = LAYOUT["configById"]
KINDS = {"Plot": float, "StateTransitions": str}
PATH = re.compile(r"(/[\w/]+)\.(\w+)(?:\[(\d+)\])?")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("layout") / "a.mcap"
    alarmed = Reading(1.0, 0.0, 2.0, Source.FALLBACK, Health.OUTLIER, Alarm.RATE)
    record(path, [*good_samples(30), Sample(9.0, 1.0, 2.0, alarmed)])
    return messages(path)


def placed(node):
    return [node] if isinstance(node, str) else [*placed(node["first"]), *placed(node["second"])]


def paths():
    """Yield each path of the layout, and the type of what it leads to."""
    for name, config in PANELS.items():
        kind = name.partition("!")[0]
        for line in config.get("paths", []):
            yield line["value"], KINDS[kind]
        if "xAxisPath" in config:
            yield config["xAxisPath"]["value"], float


def test_layout_is_of_the_form_that_viewers_import():
    assert set(LAYOUT) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert sorted(placed(LAYOUT["layout"])) == sorted(PANELS)
    for config in PANELS.values():
        assert config["foxglovePanelTitle"] == config["lichtblickPanelTitle"]


@pytest.mark.parametrize(("path", "kind"), sorted(set(paths()), key=str))
def test_each_path_leads_to_what_the_panel_shows(recorded, path, kind):
    topic, field, index = PATH.fullmatch(path).groups()
    found = [getattr(decoded, field) for _, decoded in recorded[topic]]
    if index is not None:
        found = [value[int(index)] for value in found if len(value) > int(index)]
    assert found
    assert all(isinstance(value, kind) for value in found)


def test_the_estimate_is_that_of_the_method_that_runs_without_data(recorded):
    shown = {path.partition(".")[0] for path, _ in paths()} | {PANELS["RawMessages!health"]["topicPath"]}
    assert shown == set(recorded)
    assert estimate_topic("RAM (twins)") == ESTIMATE
