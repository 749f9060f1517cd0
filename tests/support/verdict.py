"""Faults of a run: in how it ended, in what it said, and in what it changed around it."""

import json
import re
from dataclasses import dataclass, field
from pathlib import PurePosixPath

import snapshot
from hostile_runs import Ended, Place
from workbench import Command

from twin.files.shown import printable

LONGEST_SECONDS = 10.0
MOST_BYTES = 2**30
LONGEST_LINE = 300
PYTHON_WARNING = re.compile(r"\.py:\d+: \w*Warning: ")
FOR_A_PERSON = re.compile(r"^(endotwin|warning:|made anew:|\$ endotwin|\[\d/\d\]|benchmark: )|^\S.*: ")


@dataclass
class Verdict:
    """Outcome of one case.

    Attributes:
        outcome: success, refused, found (faults in a dataset: status 1), stopped (by a signal), or fault.
        faults: sentences; none if all is well.
        said: last line on stderr.
    """

    outcome: str
    faults: list[str] = field(default_factory=list)
    said: str = ""


@dataclass(frozen=True)
class Expected:
    """Rules that a run must keep.

    Attributes:
        command: that is run.
        inputs: names of the files that it reads.
        outputs: names that it writes when it succeeds.
        more: patterns of other new names, where the case gives it another output.
        planted: name of what was planted, and whether the command may replace it.
        names: words one of which a message must hold; none if any message will do.
        cpu: seconds of the processor that a good run takes.
    """

    command: Command
    inputs: frozenset[str] = frozenset()
    outputs: frozenset[str] = frozenset()
    more: tuple[str, ...] = ()
    planted: tuple[str, bool] | None = None
    names: tuple[str, ...] = ()
    cpu: float = 0.0


def outcome_of(ended: Ended, command: Command) -> str:
    if ended.stopped or "Traceback" in ended.err:
        return "fault"
    kinds = {
        0: "success",
        2: "refused",
        129: "stopped",
        130: "stopped",
        -2: "stopped",
        -15: "stopped",
        -9: "stopped",
        143: "stopped",
    }
    if ended.code == 1 and command.may_find:
        return "found"
    return kinds.get(ended.code, "fault")


def judge(
    ended: Ended, expected: Expected, place: Place, before: snapshot.Snapshot, after: snapshot.Snapshot
) -> Verdict:
    """Everything that is wrong with a run, but for outputs that do not read back."""
    outcome = outcome_of(ended, expected.command)
    faults = [
        *of_the_end(ended, outcome, max(LONGEST_SECONDS, 2 * expected.cpu)),
        *of_what_it_said(ended, outcome, expected),
    ]
    failed = outcome not in ("success", "found")
    for name, how in snapshot.differences(before, after).items():
        cut_off = bool(ended.stopped) and how.startswith("new") and is_temporary(name)
        if not cut_off and not may_differ(name, how, failed, expected):
            faults.append(f"{how}: {name}")
    if place.canary.exists():
        faults.append("CODE RAN: the canary of a pickle is there")
    return Verdict(
        "fault" if faults else outcome, faults, ended.said[-1][:LONGEST_LINE] if ended.said else ""
    )


def of_the_end(ended: Ended, outcome: str, longest: float) -> list[str]:
    faults = []
    if ended.stopped:
        return [f"{ended.stopped}; it stood at {stood_at(ended.stack)}"]
    if outcome == "fault" and "Traceback" not in ended.err:
        faults.append(f"exit status {ended.code}")
    if ended.cpu > longest:
        faults.append(f"took {ended.cpu:.1f} s of the processor")
    if ended.bytes > MOST_BYTES:
        faults.append(f"took {ended.bytes / 2**30:.2f} GiB")
    if ended.orphans:
        faults.append(f"left processes: {ended.orphans}")
    return faults


def stood_at(stack: str) -> str:
    frames = re.findall(r'File "[^"]*?((?:twin|rl|scripts)/[\w/]+\.py)", line (\d+)', stack)
    return ", ".join(f"{file}:{line}" for file, line in frames[:2]) or "no known place"


def of_what_it_said(ended: Ended, outcome: str, expected: Expected) -> list[str]:
    faults = []
    if "Traceback" in ended.err:
        inside = re.findall(r'File "[^"]*?((?:twin|rl|scripts)/[\w/]+\.py)", line (\d+)', ended.err)
        where = ":".join(inside[-1]) if inside else "?"
        last = [line for line in ended.said if re.match(r"[\w.]+(Error|Exception|Interrupt|Exit)\b", line)]
        faults.append(f"traceback in {where}: {last[-1][:150] if last else ended.said[-1][:150]}")
        return faults
    if any(PYTHON_WARNING.search(line) for line in ended.said):
        faults.append(
            "a warning of Python: " + next(line for line in ended.said if PYTHON_WARNING.search(line))[-150:]
        )
    if outcome == "refused":
        faults += of_the_line(ended, expected)
    if outcome == "success" and not ended.out.strip():
        faults.append("succeeds and says nothing")
    if any(ord(letter) < 32 and letter not in "\n\r\t" for letter in ended.err.replace("\x1b[A", "")):
        faults.append("control characters on stderr")
    return faults


def of_the_line(ended: Ended, expected: Expected) -> list[str]:
    """Faults of the line of a refusal."""
    if not ended.said:
        return ["exit status 2 and not a word"]
    *others, line = ended.said
    faults = []
    if len(line) > LONGEST_LINE:
        faults.append(f"a line of {len(line)} characters: {line[:80]}...")
    if not line.startswith("endotwin"):
        faults.append(f"the last line is no message of endotwin: {line[:120]}")
    strange = [other for other in others if not FOR_A_PERSON.match(other)]
    if strange and not expected.command.fails:
        faults.append(f"{len(strange)} more lines than one: {strange[0][:100]}")
    if "a fault of the program" in line:
        faults.append(line[:200])
    words = [" ".join(spelled.split()) for name in expected.names for spelled in (name, printable(name))]
    if any(words) and not any(word in line for word in words if word):
        faults.append(f"names none of {', '.join(expected.names)[:80]}: {line[:160]}")
    if len(line.partition(": ")[2]) < 8:
        faults.append(f"says nothing: {line!r}")
    return faults


def may_differ(name: str, how: str, failed: bool, expected: Expected) -> bool:
    """Whether something around a run may have changed so."""
    if not name.startswith("work/"):
        return False
    name, command = name.removeprefix("work/"), expected.command
    if expected.planted and name == expected.planted[0]:
        return expected.planted[1]
    if expected.planted and name.startswith(f"{expected.planted[0]}/"):
        return False
    if failed:
        # An empty folder is made to prove that it can be written, before any long work.
        kept = snapshot.matches(name, command.kept) or is_kept_elsewhere(name, expected)
        return kept or (how == "new folder" and may_write(name, expected))
    if how.startswith("new"):
        named = any(part in expected.more for part in (name, *map(str, PurePosixPath(name).parents)))
        return may_write(name, expected) and (named or not is_temporary(name))
    if snapshot.matches(name, command.outputs) and not expected.more:
        return True  # its own, such as a damaged episode that is made anew
    if name in expected.inputs and name not in expected.outputs:
        return False
    return name in expected.outputs or (bool(expected.more) and is_output_of(name, expected))


def may_write(name: str, expected: Expected) -> bool:
    below = any(name.startswith(f"{pattern}/") for pattern in (*expected.command.outputs, *expected.more))
    return below or snapshot.matches(name, (*expected.command.outputs, *expected.more))


def is_kept_elsewhere(name: str, expected: Expected) -> bool:
    """Whether it may stay for the next run, under an output that the case has named."""
    last = PurePosixPath(name).name
    kept = tuple(PurePosixPath(pattern).name for pattern in expected.command.kept)
    return snapshot.matches(name, expected.more) and snapshot.matches(last, kept)


def is_output_of(name: str, expected: Expected) -> bool:
    """Whether an existing file is one that the command writes under the output that it was given."""
    known = {PurePosixPath(output).name for output in expected.outputs} | {"dataset.json", "README.md"}
    return name in expected.more or (
        PurePosixPath(name).name in known and snapshot.matches(name, expected.more)
    )


def is_temporary(name: str) -> bool:
    parts = PurePosixPath(name).parts
    return any(".part" in part or part.endswith((".tmp", ".lock", "~")) for part in parts)


def unread(ended: Ended) -> list[str]:
    """Faults that `read_back.print_faults` has printed."""
    if ended.code != 0 or ended.stopped:
        return [f"reading back fails: {ended.stopped or ended.said[-1:]}"]
    return [f"does not read back: {name}: {text}" for name, text in json.loads(ended.out).items()]
