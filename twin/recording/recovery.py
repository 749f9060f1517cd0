"""Recovery of an episode from a file that is cut off or damaged."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from twin.episode import Episode
from twin.errors import InputError
from twin.recording.contents import TOPICS, Contents, from_json
from twin.recording.mcap_file.records import mcap_bytes
from twin.recording.messages import LARGEST_TIME
from twin.recording.reader import one_line, whole_contents, whole_episode
from twin.recording.salvage import Salvage

_CLOCK = "/command"  # every sample has a message on it, in whole files
_MAY_BE_MISSING = "/measurement"
_FAULTS_IN_SUMMARY = 3


@dataclasses.dataclass(frozen=True)
class Recovered:
    """Recovered part of an episode: its complete samples, in order; missing ones are gaps in time.

    Attributes:
        episode: the complete samples; its metadata has an item `recovered`, unless the file has no fault.
        samples: number of complete samples.
        samples_expected: number of samples that the file once had; None if unknown.
        seconds: duration of the complete samples [s].
        faults: faults of the file, one line each.
        chunks: number of intact chunks; 0 also for a file that is written without chunks.
        chunks_lost: number of damaged chunks; None if unknown.
    """

    episode: Episode
    samples: int
    samples_expected: int | None
    seconds: float
    faults: tuple[str, ...] = ()
    chunks: int = 0
    chunks_lost: int | None = None

    @property
    def summary(self) -> str:
        """Summary in one sentence: the share that is intact, and the faults."""
        if self.samples_expected is None:
            whole = f"{self.samples:,} samples ({self.seconds:.1f} s) are whole of an unknown number"
        else:
            expected_seconds = self.samples_expected * self.episode.sample_time
            whole = (
                f"{self.samples:,} of {self.samples_expected:,} samples "
                f"({self.seconds:.1f} of {expected_seconds:.1f} s) are whole"
            )
        more = len(self.faults) - _FAULTS_IN_SUMMARY
        others = [_many(more, "more fault")] if more > 0 else []
        return "; ".join([whole, *self.faults[:_FAULTS_IN_SUMMARY], *others])


def recover_episode(path: str | Path) -> Recovered:
    """Read the intact part of an episode; of a file without fault, the same as `read_episode`.

    A sample is whole if all topics of the episode have it in chunks whose CRCs match. `/measurement` may be
    missing, as where a sensor saw nothing, but not next to something lost: it may be among that.

    Args:
        path: an MCAP file, cut off anywhere or damaged in the middle.

    Returns:
        The samples, how many are missing and why.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is not an MCAP file, or no metadata or fewer than two samples are whole.
    """
    path = Path(path)
    data = mcap_bytes(path, cut=True)
    try:
        contents = whole_contents(data)
        episode = whole_episode(contents)
    except ValueError as error:
        refused = str(error)
    else:
        count = len(episode.time)
        return Recovered(episode, count, count, _seconds(episode), (), contents.counts["chunk"], 0)
    try:
        return _recovered(Salvage(data), refused)
    except MemoryError:
        raise
    except Exception as error:
        reason = one_line(error)
        repeated = refused.endswith(reason)
        raise InputError(
            f"{path} {refused}; nothing can be recovered" + ("" if repeated else f": {reason}")
        ) from error


def _recovered(salvage: Salvage, refused: str) -> Recovered:
    """Return the episode of the records salvaged from a file that the reader has refused."""
    contents = salvage.contents
    faults = [*salvage.faults]
    metadata = _metadata(contents, faults)
    expected = _expected(salvage, metadata)
    faults += _keep_whole_samples(salvage)
    count = len(contents.times[_CLOCK])
    if count < 2:
        raise InputError(f"{count} samples are whole: an episode has two or more")
    if expected is not None and not count <= expected <= LARGEST_TIME:
        expected = None  # no clock can have seen it
    metadata["recovered"] = {"samples": count, "expected": expected}
    episode = contents.episode(metadata)
    return Recovered(
        episode=episode,
        samples=count,
        samples_expected=expected,
        seconds=_seconds(episode),
        faults=tuple(faults or [refused.removeprefix("is damaged: ")]),
        chunks=salvage.chunks,
        chunks_lost=salvage.chunks_lost,
    )


def _seconds(episode: Episode) -> float:
    return len(episode.time) * episode.sample_time


def _many(number: int, thing: str) -> str:
    return f"{number:,} {thing}" + ("s" if number > 1 else "")


def _metadata(contents: Contents, faults: list[str]) -> dict[str, Any]:
    """Return the readable items of the metadata; no CRC but that of the whole file covers them."""
    if contents.items is None:
        return contents.metadata()  # says that it is missing
    metadata = {}
    for name, text in contents.items.items():
        try:
            metadata[name] = from_json(name, text)
        except (ValueError, RecursionError) as error:
            faults.append(one_line(error))
    return metadata


def _expected(salvage: Salvage, metadata: dict[str, Any]) -> int | None:
    """Return the number of samples that the file once had, by its summary or its metadata."""
    if salvage.statistics is not None:
        counts = salvage.statistics.channel_message_counts
        topics = salvage.contents.topics
        return sum(int(count) for channel, count in counts.items() if topics.get(channel) == _CLOCK)
    if salvage.data_whole and salvage.chunks_lost == 0:
        return len({*salvage.contents.times.get(_CLOCK, ())})
    samples = metadata.get("samples")
    return samples if type(samples) is int else None


def _keep_whole_samples(salvage: Salvage) -> Iterator[str]:
    """Keep only the messages of complete samples, in the order of time; yields the faults of the others."""
    contents = salvage.contents
    required = contents.required_topics
    for topic in sorted(({*required, *contents.topics.values()} & TOPICS) - {*contents.times}):
        if topic in required:
            raise InputError(f"no message of topic {topic} is whole")
        yield f"no message of topic {topic} is whole"
    # Reversed, so that the first message at a time is the one that stays.
    messages = {
        topic: dict(zip(reversed(contents.times[topic]), reversed(contents.payloads[topic]), strict=True))
        for topic in contents.times
    }
    repeated = sum(len(contents.times[topic]) - len(messages[topic]) for topic in messages)
    if repeated > 0:
        yield f"{_many(repeated, 'message')} at the time of another on the same topic: left out"

    always = [topic for topic in messages if topic != _MAY_BE_MISSING]
    common = sorted(set.intersection(*(set(messages[topic]) for topic in always)))
    doubtful = salvage.doubtful(common).tolist()
    measured = messages[_MAY_BE_MISSING]
    whole = [time for time, doubt in zip(common, doubtful, strict=True) if time in measured or not doubt]
    partial = len(set.union(*(set(times) for times in messages.values()))) - len(whole)
    if partial > 0:
        yield f"{_many(partial, 'sample')} without all topics: left out"
    for topic, known in messages.items():
        contents.times[topic] = [time for time in whole if time in known]
        contents.payloads[topic] = [known[time] for time in contents.times[topic]]
