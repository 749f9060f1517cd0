"""Runs of a command with one thing that is hostile: a file that it reads, a name where it writes, an option.

A run must end in good output, or in one line and exit code 2, and must touch nothing else.
"""

import dataclasses
import hashlib
import importlib
import json
import os
import re
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import hostile_edits
import hostile_numbers
import numpy as np
from pickles import PICKLES
from typed import Typed, typed_words
from workspace import COMMANDS, Command, copied, matches

from scripts.command import LONGEST_LINE, MODULES
from twin.recording import read_episode

VARIABLE = "HOSTILE"
"""Environment variable that names cases, one in a line, to run them alone."""
LIMIT_SECONDS = 120
"""When a run is stopped: it hangs, unless the machine is very busy."""
BAR = re.compile(r"\d+%\|.*\[|\[[\d:?]+(<[\d:?]+)?, .*/s|it/s\b")
"""A bar of progress as tqdm draws it."""
FOR_A_PERSON = re.compile(r"^(endotwin|warning:|made |benchmark: )|^\S.*: ")


class Case(NamedTuple):
    """One run.

    Attributes:
        command: name in the table of commands.
        family: file, number, plant, argument or clean.
        target: name of the file, or of the output next to which something is planted.
        what: damage or plant.
        seed: of its random parts.
    """

    command: str
    family: str
    target: str
    what: str
    seed: int

    def __str__(self) -> str:
        return "|".join(map(str, self))


PLANTED = {
    "output": lambda path: path.name,
    "temporary": lambda path: f".{path.name}.partial",
    "tmp": lambda path: f"{path.name}.tmp",
    "lock": lambda path: f".{path.name}.lock",
    "backup": lambda path: f"{path.name}~",
}
"""Names next to an output, or its own, under which something may stand."""
THINGS = hostile_edits.REPLACED.keys() - {"removed", "link to zeros", "link to noise"}
PLANTS = [f"{thing} as {name}" for thing in sorted(THINGS) for name in PLANTED]


def drawn(count: int, root: Path, commands: list[str]) -> Iterator[Case]:
    """Damage to files that commands read, and things planted where they write, in turn."""
    for seed in range(count):
        rng = np.random.default_rng(seed)
        name = commands[seed % len(commands)]
        command = COMMANDS[name]
        reads = command.reads(root)
        outputs = [output for output in command.outputs if "*" not in output]
        if outputs and rng.random() < 0.25:
            yield Case(name, "plant", hostile_edits.pick(rng, outputs), hostile_edits.pick(rng, PLANTS), seed)
        else:
            file = hostile_edits.pick(rng, reads)
            what = hostile_edits.pick(rng, hostile_edits.names_of(root / file))
            yield Case(name, "file", file, what, seed)


def pickles(root: Path, *, every: bool) -> Iterator[Case]:
    """A pickle in a file of every kind that a verb reads; `every`: in each file, in all wrappings."""
    seen = set()
    for name, command in COMMANDS.items():
        if command.slow and not every:
            continue
        for file in command.reads(root):
            kind = Path(file).suffix if not every else (file, name)
            if kind not in seen:
                seen.add(kind)
                names = [one for one in hostile_edits.names_of(root / file) if one in PICKLES]
                yield from (Case(name, "file", file, one, 0) for one in (names if every else names[-1:]))


def numbers(count: int, root: Path, commands: list[str]) -> Iterator[Case]:
    """Extreme numbers in files that commands read, in turn; checksums stay valid."""
    for seed in range(count):
        rng = np.random.default_rng(seed)
        name = commands[seed % len(commands)]
        files = [file for file in COMMANDS[name].reads(root) if Path(file).suffix in hostile_numbers.EDITS]
        # A recording is most of what there is to read; without this, there would be more of other files.
        recordings = [file for file in files if file.endswith(".mcap") and rng.random() < 0.7]
        yield Case(name, "number", hostile_edits.pick(rng, recordings or files), "extreme", seed)


NUMBERS = (
    "-1", "0", "nan", "inf", "1e400", "1000000000", "9" * 5000, "-1e18", "0.5", "0x10", "1_0", "\u0661",
    "1e300", "-1e300", "1e39", "1e-320", "-0.0", "1000000000000000000",
)  # fmt: skip
WORDS = (
    "", " ", "x" * 5000, "two\nlines", "a\rb\x1b[31mred", "--out", "-", "--", "\udcff", "null", "=", "a=b",
)  # fmt: skip
PATHS = (
    ".", "..", "../outside", "../outside/precious.txt", "log.csv/inside", "data", "data/train/dataset.json",
    "small.yaml", "x" * 300, "x/" * 200 + "x", "two\nlines.yaml", "no/such/folder", "/proc/none", "/dev/full",
    "/dev/null", "coleman_hodgdon.json", "runs/ram/policy.onnx", "missing.yaml", "~", "*",
)  # fmt: skip
SKIPPED = {"dask", "live", "live-port", "json", "help"}
"""Options that wait for another machine or for a viewer, or that are no value."""


def options_of(verb: str) -> list[str]:
    """Options of a verb: the fields of its dataclass."""
    module = importlib.import_module(f"scripts.{MODULES.get(verb, verb)}")
    (options,) = [
        item
        for item in vars(module).values()
        if dataclasses.is_dataclass(item) and isinstance(item, type) and item.__module__ == module.__name__
    ]
    return [field.name.replace("_", "-") for field in dataclasses.fields(options)]


def with_a_mistake(command: Command, seed: int) -> list[str]:
    """Words of a command with one option that is hostile, missing or unknown."""
    rng = np.random.default_rng(seed)
    words = command.words
    flag = f"--{hostile_edits.pick(rng, sorted({*options_of(words[0])} - SKIPPED))}"
    value = hostile_edits.pick(rng, PATHS if flag == "--out" or rng.random() < 0.25 else (*NUMBERS, *WORDS))
    if rng.random() < 0.05:
        return [*words, f"{flag}s", value]
    if flag not in words:
        return [*words, flag, value]
    at = words.index(flag)
    return [*words[: at + 1], *([value] if rng.random() < 0.9 else []), *words[at + 2 :]]


def arguments(count: int, commands: list[str]) -> Iterator[Case]:
    for seed in range(count):
        yield Case(commands[seed % len(commands)], "argument", "-", "drawn", seed)


def snapshot(folder: Path) -> dict[str, str]:
    """Content of each file, target of each link, kind of anything else; nothing is followed or opened."""
    found = {}
    for path in folder.rglob("*"):
        if path.is_symlink():
            content = f"link to {os.readlink(path)}"
        elif path.is_file():
            size = path.stat().st_size
            content = str(size) if size > 2**30 else hashlib.sha256(path.read_bytes()).hexdigest()
        else:
            content = "folder" if path.is_dir() else "other"
        found[path.relative_to(folder).as_posix()] = content
    return found


def changes(before: dict[str, str], after: dict[str, str]) -> dict[str, str]:
    """Names that differ, each with how: new, removed or changed."""
    names = sorted(name for name in {*before, *after} if before.get(name) != after.get(name))
    return {n: "new" if n not in before else "removed" if n not in after else "changed" for n in names}


class Hangs(BaseException):
    """A run that does not end."""


def run_limited(words: list[str], folder: Path) -> Typed:
    """Run a command in this process, for so long."""

    def stop(*_: object) -> None:
        raise Hangs

    former = signal.signal(signal.SIGALRM, stop)
    signal.alarm(LIMIT_SECONDS)
    try:
        return typed_words(words, folder)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, former)


def faults_of(case: Case, root: Path, tmp: Path) -> list[str]:
    """Run a case in a copy of the workspace; everything that is wrong with how it ends."""
    command, words = COMMANDS[case.command], COMMANDS[case.command].words
    around, canary, planted = tmp / "around", tmp / "canary", ""
    for folder in ("outside", "tmp"):
        (around / folder).mkdir(parents=True)
    (around / "outside" / "precious.txt").write_text("worth a year\n")
    with copied(root, around / "work") as work, mock.patch.object(tempfile, "tempdir", str(around / "tmp")):
        if case.family == "file":
            hostile_edits.damage(work / case.target, case.what, around / "outside", canary, case.seed)
        elif case.family == "number":
            hostile_numbers.put_number(work / case.target, case.seed)
        elif case.family == "plant":
            thing, name = case.what.split(" as ")
            path = (work / case.target).with_name(PLANTED[name](Path(case.target)))
            hostile_edits.remove(path)
            hostile_edits.REPLACED[thing](path, around / "outside")
            planted = "" if name == "output" and thing != "a folder" else path.relative_to(work).as_posix()
            if name in ("temporary", "lock", "tmp") and not path.is_dir():
                planted = ""  # as a killed run of the command leaves it
        elif case.family == "argument":
            words = with_a_mistake(command, case.seed)
        before = snapshot(around)
        try:
            ended = run_limited(words, work)
        except BaseException as error:
            return [f"raises {type(error).__name__}: {str(error)[:150]}"]
        faults = list(of_the_end(ended, command))
        if case.family == "number" and ended.code == 2:
            named = {case.target, *(word for word in words[1:] if (root / word).exists())}  # or its folder
            if not any(Path(name).name in ended.err for name in named):
                faults.append(f"does not name the file: {ended.err[-200:]}")
        changed = changes(before, snapshot(around))
        any_output = case.family == "argument" and words != command.words
        for name, how in changed.items():
            short = name.removeprefix("work/")
            is_planted = planted and (short == planted or short.startswith(f"{planted}/"))
            if is_planted or short == name or not may_change(command, ended.code, short, how, any_output):
                faults.append(f"{how} by a run that ends with {ended.code}: {name}")
            elif ended.code == 0 and how != "removed":
                faults += unreadable(work / short)
    if canary.exists():
        faults.append("CODE RAN: the canary of a pickle is there")
    return faults


def may_change(command: Command, code: int, name: str, how: str, any_output: bool) -> bool:
    """Whether a run may have changed a file so; `any_output`: it was given another output than usual."""
    if code == 2:  # folders are made to prove that they can be written, before any long work
        return matches(name, command.kept) or (how == "new" and any_output and bool(command.kept))
    return matches(name, command.outputs) or (how == "new" and any_output)


def of_the_end(ended: Typed, command: Command) -> Iterator[str]:
    """Faults of the exit code and of what was printed."""
    said = [line for line in re.split(r"[\r\n]+", ended.err) if line.strip() and not BAR.search(line)]
    if ended.code not in (0, 2) and not (ended.code == 1 and command.may_find):
        yield f"exit code {ended.code}"
    if "Traceback" in ended.err or "a fault of the program" in ended.err:
        yield f"a fault of the program: {said[-1][:200]}"
    if any(ord(letter) < 32 and letter not in "\n\r\t" for letter in ended.err.replace("\x1b[A", "")):
        yield "control characters on stderr"
    if ended.code == 2 and (not said or not said[-1].startswith("endotwin") or len(said[-1]) > LONGEST_LINE):
        yield f"the last line is no message: {said[-1:]}"
    if ended.code == 2 and [line for line in said[:-1] if not FOR_A_PERSON.match(line)]:
        yield f"more lines than one: {said[:3]}"
    if ended.code == 0 and not ended.out.strip():
        yield "succeeds and prints nothing"


def unreadable(path: Path) -> Iterator[str]:
    """A fault if an output does not read back."""
    try:
        if path.is_file() and path.suffix == ".json":
            json.loads(path.read_text())
        if path.is_file() and path.suffix == ".mcap":
            read_episode(path)
    except (ValueError, OSError) as error:
        yield f"does not read back: {path.name}: {error}"


def run_all(cases: Iterator[Case], root: Path, tmp: Path) -> None:
    """Run cases one after the other, and fail with one line for each fault."""
    named = [line.split("|") for line in os.environ.get(VARIABLE, "").splitlines()]
    chosen = [Case(*parts, int(seed)) for *parts, seed in named] or list(cases)
    found = []
    for number, case in enumerate(chosen):
        for fault in faults_of(case, root, tmp / str(number)):
            found.append(f"{VARIABLE}='{case}': {fault}")
            print(found[-1], flush=True)  # at once: thousands take an hour
    assert not found, "\n".join(found[:40])
