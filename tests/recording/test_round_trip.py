"""The recording: what is written comes back, and a file is whole or not there."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import assert_equal, make_episode

from twin.episode import OPTIONAL
from twin.recording import EpisodeWriter, read_dataset, read_episode, write_episode
from twin.recording.facts import EpisodeFacts


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder for all examples of a property: each example overwrites its file."""
    return tmp_path_factory.mktemp("recording")


# What is written comes back


@settings(max_examples=25, deadline=None)
@given(
    samples=st.integers(2, 30),
    vertebrae=st.integers(0, 6),
    elements=st.none() | st.integers(0, 5),
    seed=st.integers(0, 2**32 - 1),
    start=st.sampled_from([0.0, 0.01, 1234.56]),
    planes=st.sampled_from([1, 2]),
    drive=st.booleans(),
    drawn=st.booleans(),
)
def test_round_trip(folder, samples, vertebrae, elements, seed, start, planes, drive, drawn):
    written = make_episode(samples, vertebrae, elements, seed, start, planes=planes, drive=drive, drawn=drawn)
    path = write_episode(folder / "round.mcap", written)
    assert_equal(read_episode(path), written)


@pytest.mark.parametrize("planes", [1, 2])
def test_hidden_state_is_left_out_on_request(tmp_path, planes):
    written = make_episode(planes=planes, drive=True)
    path = write_episode(tmp_path / "seen.mcap", written)
    bare = {"wire_tension": 3, "sheath_friction": 3, "joint_angle": 2}
    for read in (read_episode(path, hidden=False), *read_dataset(tmp_path, hidden=False)):
        for name, axes in bare.items():
            assert getattr(read, name).shape[axes - 1] == 0
            read = dataclasses.replace(read, **{name: getattr(written, name)})
        hidden = ("wire_slack", "lateral_joint_angle")
        assert_equal(dataclasses.replace(read, **{name: getattr(written, name) for name in hidden}), written)


@pytest.mark.parametrize("field", OPTIONAL)
def test_each_optional_field_comes_back_without_the_others(tmp_path, field):
    whole = make_episode(planes=2, drive=True)
    others = {name: np.empty(0) for name in OPTIONAL if name != field}
    wires = slice(4 if field.startswith("lateral") else 2)
    written = dataclasses.replace(
        whole,
        **others,
        wire_tension=whole.wire_tension[:, wires],
        sheath_friction=whole.sheath_friction[:, wires],
    )
    if field == "wire_slack":
        written = dataclasses.replace(written, wire_slack=whole.wire_slack[:, wires])
    assert_equal(read_episode(write_episode(tmp_path / "a.mcap", written)), written)


@settings(max_examples=25, deadline=None)
@given(missing=st.lists(st.booleans(), min_size=2, max_size=30).filter(lambda missing: not all(missing)))
def test_missing_measurements_come_back_missing(folder, missing):
    whole = make_episode(len(missing))
    written = dataclasses.replace(whole, measured_bend=np.where(missing, np.nan, whole.measured_bend))
    path = write_episode(folder / "holes.mcap", written)
    assert_equal(read_episode(path), written)
    assert write_episode(folder / "again.mcap", written).read_bytes() == path.read_bytes()


@settings(max_examples=25, deadline=None)
@given(
    st.dictionaries(
        st.text(st.characters(codec="utf-8"), max_size=8),
        st.recursive(
            st.none()
            | st.booleans()
            | st.integers()
            | st.floats(allow_nan=False, allow_infinity=False)
            | st.text(),
            lambda inner: (
                st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
            ),
            max_leaves=6,
        ),
        max_size=4,
    ),
    st.dictionaries(st.text(st.characters(codec="utf-8"), max_size=8), st.binary(max_size=50), max_size=3),
)
def test_metadata_and_attachments_survive(folder, metadata, attachments):
    metadata = {name: value for name, value in metadata.items() if name not in EpisodeFacts.model_fields}
    written = dataclasses.replace(make_episode(2), metadata=metadata, attachments=attachments)
    assert_equal(read_episode(write_episode(folder / "meta.mcap", written)), written)


def test_same_episode_same_bytes(tmp_path, monkeypatch):
    episode = make_episode()
    shuffled = dataclasses.replace(
        episode,
        metadata=dict(reversed(episode.metadata.items())),
        attachments=dict(reversed(episode.attachments.items())),
    )
    first = write_episode(tmp_path / "a.mcap", episode).read_bytes()
    monkeypatch.setattr("time.time", lambda: 1e9)
    monkeypatch.setattr("time.time_ns", lambda: 10**18)
    assert write_episode(tmp_path / "b.mcap", shuffled).read_bytes() == first
    assert write_episode(tmp_path / "c.mcap", make_episode(seed=1)).read_bytes() != first


# Written whole or not at all


def test_exception_leaves_the_file_of_before(tmp_path):
    path = write_episode(tmp_path / "a.mcap", make_episode(seed=1))
    with pytest.raises(ValueError, match="is not JSON"):
        write_episode(path, dataclasses.replace(make_episode(), metadata={"seed": float("nan")}))
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
    assert read_episode(path).metadata["seed"] == 1


@pytest.mark.parametrize(
    ("planes", "changes", "fault"),
    [
        (1, {"time": np.arange(12) - 1.0}, "runs from -1 to 10 s"),
        (1, {"time": np.arange(12) * 1e9}, "0 to 9.2e9 s"),
        (1, {"time": np.arange(12) * 1e-10}, "sample 1 is less than 1 ns"),
        (1, {"wire_tension": np.zeros((12, 4, 1))}, r"shape \(12, 4, 1\) for 12 samples: must be \(N, "),
        (2, {"wire_tension": np.zeros((12, 2, 1))}, r"shape \(12, 2, 1\) for 12 samples: must be \(N, "),
        (2, {"sheath_friction": np.zeros((12, 2, 1))}, r"must be \(N, "),
        (1, {"joint_angle": np.zeros(12)}, r"must be \(N, "),
        (1, {"joint_angle": np.zeros((12, 5))}, "joint_angle has 5 columns, the preset 3 vertebrae"),
        (2, {"lateral_joint_angle": np.zeros((12, 2))}, r"lateral_joint_angle has shape \(12, 2\)"),
        (1, {"wire_slack": np.zeros((12, 4, 3))}, r"wire_slack has shape \(12, 4, 3\) .* must be \(N, "),
        (2, {"wire_slack": np.zeros(12)}, r"must be \(N, "),
        (1, {"pulley": np.zeros((12, 1))}, r"pulley has shape \(12, 1\) for 12 samples: must be \(N\)"),
        (1, {"measured_bend": np.full(12, np.nan)}, "measured_bend is NaN at every sample"),
        (1, {"metadata": {"when": object()}}, "metadata 'when' is not JSON: a object cannot be stored"),
    ],
)
def test_episode_that_does_not_fit_is_refused(tmp_path, planes, changes, fault):
    with pytest.raises(ValueError, match=fault):
        write_episode(tmp_path / "a.mcap", dataclasses.replace(make_episode(planes=planes), **changes))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_exception_leaves_nothing(tmp_path, error):
    def fail_half_way() -> None:
        with EpisodeWriter(tmp_path / "a.mcap") as writer:
            writer.write(make_episode())
            assert not (tmp_path / "a.mcap").exists()
            raise error

    with pytest.raises(error):
        fail_half_way()
    assert list(tmp_path.iterdir()) == []
