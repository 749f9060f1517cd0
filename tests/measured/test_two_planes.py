"""A log of two bending planes: the lateral command and angle become those of wires c and d."""

import json

import numpy as np
import pytest
from csv_logs import steps, write

from scripts.import_log import main
from twin.measured.log import LogFormat, read_measured_log
from twin.recording import read_dataset

PLANES = {"lateral_command_column": "side_deg", "lateral_angle_column": "tilt_deg"}
LOG = steps(side_deg=[3, 1, -2, 0], tilt_deg=[1.5, 0.5, -1, -0.5])


def test_the_second_plane_is_read_in_si_units_and_comes_back_from_the_file(tmp_path):
    form = LogFormat(pulley_radius=0.02, **PLANES)
    episode = read_measured_log(write(tmp_path, LOG), form)
    np.testing.assert_allclose(episode.lateral_pull, np.radians(LOG["side_deg"]) * 0.02, rtol=1e-12)
    np.testing.assert_allclose(np.degrees(episode.lateral_bend), LOG["tilt_deg"], rtol=1e-12)
    np.testing.assert_allclose(episode.truth_deg, LOG["angle_deg"], rtol=1e-12)
    assert episode.wire_tension.shape == (4, 4, 0)
    turned = read_measured_log(tmp_path / "log.csv", LogFormat(reverse_lateral_angle=True, **PLANES))
    np.testing.assert_array_equal(turned.lateral_bend, -episode.lateral_bend)
    np.testing.assert_array_equal(turned.bend, episode.bend)
    columns = ["--lateral-command-column", "side_deg", "--lateral-angle-column", "tilt_deg"]
    line = [str(tmp_path / "log.csv"), *columns, "--pulley-radius-mm", "20", "--out", str(tmp_path / "out")]
    assert main(line) == 0
    (read,) = read_dataset(tmp_path / "out")
    np.testing.assert_allclose(read.lateral_pull, episode.lateral_pull, atol=1e-15)
    np.testing.assert_allclose(read.lateral_bend, episode.lateral_bend, rtol=1e-12)
    assert read.metadata["lateral_angle_column"] == "tilt_deg"
    features = json.loads((tmp_path / "out" / "dataset.json").read_text())["features"]
    assert {"lateral_pull_mm", "lateral_bend_deg"} <= features.keys()


def test_a_sample_counts_as_measured_where_both_angles_are(tmp_path):
    said = []
    columns = {
        "time_s": [0, 1, 4, 5, 6],
        "command_deg": [0, 1, 2, 1, 0],
        "angle_deg": [0, "", 4, 2, 0],
        "side_deg": [2, "", 1, 0, 1],
        "tilt_deg": [1, 2, "", 6, ""],
    }
    log = write(tmp_path, columns)
    episode = read_measured_log(log, LogFormat(**PLANES), on_warning=said.append)
    np.testing.assert_allclose(episode.measured_deg, [0, np.nan, np.nan, 2, np.nan])
    np.testing.assert_allclose(episode.truth_deg, [0, 1, 4, 2, 0])
    np.testing.assert_allclose(np.degrees(episode.lateral_bend), [1, 2, 5, 6, 6])
    np.testing.assert_allclose(np.degrees(episode.lateral_pull) * 100, [2, 2, 1, 0, 1])
    rest = "is missing, as in"
    assert said == [
        f"{log} line 3: angle_deg {rest} 1 of 5 rows: nothing is measured there, in either plane",
        f"{log} line 3: side_deg {rest} 1 of 5 rows: the last one is held",
        f"{log} line 4: tilt_deg {rest} 2 of 5 rows: nothing is measured there, in either plane",
    ]
    assert episode.metadata["commands_held"] == 1


@pytest.mark.parametrize(
    ("columns", "form", "fault"),
    [
        (
            LOG,
            {"lateral_angle_column": None},
            "give `lateral_command_column` and `lateral_angle_column` both",
        ),
        (LOG, {"lateral_command_column": None}, "`lateral_angle_column` both, or neither"),
        (LOG, {"lateral_command_column": "command_deg"}, "column command_deg is named twice"),
        (LOG, {"lateral_angle_column": "angle_deg"}, "column angle_deg is named twice"),
        (
            LOG,
            {"reverse_lateral_angle": True, "lateral_command_column": None, "lateral_angle_column": None},
            "`reverse_lateral_angle` turns an angle: name its `lateral_angle_column` too",
        ),
        (LOG, {"lateral_angle_column": "sway_deg"}, "has no column sway_deg; its columns: time_s"),
        (LOG | {"side_deg": ["", 1, 2, 3]}, {}, "line 2: side_deg is missing, and no row before it has one"),
        (LOG | {"tilt_deg": [0, "x", 2, 3]}, {}, "line 3: tilt_deg is 'x', not a finite number"),
        (
            LOG | {"tilt_deg": [0, 1, 721, 3]},
            {},
            "line 4: tilt_deg is 721 deg, which is not from -720 to 720",
        ),
        (
            LOG | {"angle_deg": [0, 1, "", ""], "tilt_deg": ["", 1, 2, 3]},
            {},
            "angle_deg and tilt_deg are both measured 1 times, a record needs two",
        ),
    ],
)
def test_a_second_plane_that_cannot_be_is_refused(tmp_path, columns, form, fault):
    with pytest.raises(ValueError, match=r"^[^\n]*$") as caught:
        read_measured_log(write(tmp_path, columns), LogFormat(**(PLANES | form)))
    assert fault in str(caught.value)
