"""The samples that ship: as they were made, readable, whole, and never in the way of a file of the user's."""

import json

import numpy as np
import pytest

from scripts.samples import copy_samples, sample_files
from scripts.studies.make_samples import NOISE_DEG2, make_samples
from twin.dataset.verify import verify
from twin.errors import InputError
from twin.files.assets import assets_folder
from twin.live.lines import SampleLine
from twin.measured.log import read_measured_log


@pytest.mark.slow
def test_samples_are_those_that_their_module_makes(tmp_path):
    make_samples(tmp_path)
    for name, path in sample_files().items():
        if name.endswith((".csv", ".jsonl")):
            ours = np.genfromtxt((tmp_path / name).read_text().replace(":", ",").splitlines(), delimiter=",")
            theirs = np.genfromtxt(path.read_text().replace(":", ",").splitlines(), delimiter=",")
            np.testing.assert_allclose(ours, theirs, atol=2e-3, equal_nan=True)  # of another machine's libm


def test_the_tiny_dataset_is_whole():
    assert verify(assets_folder() / "samples/dataset") == ([], 2)


def test_loops_reach_less_the_more_their_sheath_is_bent_and_are_noisy_as_stated():
    reached = []
    for bend in (0, 30, 90, 180):
        log = read_measured_log(assets_folder() / f"samples/loop_{bend:03d}.csv")
        reached.append(np.ptp(log.truth_deg))
        rough = np.diff(log.truth_deg, 2).std() / np.sqrt(6)
        assert rough**2 == pytest.approx(NOISE_DEG2, rel=0.35)
    assert np.all(np.diff(reached) < -3)


def test_every_line_of_the_stream_is_a_sample():
    lines = sample_files()["samples.jsonl"].read_text().splitlines()
    assert len(lines) == 200
    assert [SampleLine.model_validate(json.loads(line)).time_s for line in lines][:2] == [0.0, 0.1]


def test_copies_are_made_once_and_replace_nothing(tmp_path):
    made = copy_samples(tmp_path)
    assert (tmp_path / "dataset/dataset.json") in made
    before = (tmp_path / "bench.csv").stat().st_mtime_ns
    assert copy_samples(tmp_path) == made
    assert (tmp_path / "bench.csv").stat().st_mtime_ns == before
    (tmp_path / "bench.csv").write_text("mine\n")
    with pytest.raises(InputError, match=r"bench.csv is there and is no copy of the sample"):
        copy_samples(tmp_path)
    assert (tmp_path / "bench.csv").read_text() == "mine\n"
