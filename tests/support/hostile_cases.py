"""Cases by the thousand, each named by one line: a command, and one thing that is hostile."""

import os
import re
import shlex
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import NamedTuple

import hostile_arguments
import numpy as np
import snapshot
from built_workbench import Workbench, one_place
from hostile_files import mutate, mutations_of
from hostile_planted import PLANTS, is_of_the_command, plant
from hostile_runs import MOST_CPU_SECONDS, Ended, Place, Runner, console, job
from pickles import PICKLES
from verdict import Expected, Verdict, judge, unread
from workbench import BY_NAME, COMMANDS

from scripts.command import one_line

VARIABLE = "HOSTILE"
"""Environment variable that names cases, one in a line, to run them alone."""
FIRST = "HOSTILE_FIRST"
"""Environment variable with the number of the first case to run: a long run goes on there."""
CONTROL = 60
"""Each case of this number is run by the real console command instead of a fork."""

LIKELY = {"zip": ["pickle in data", "pickle in npz", "pickle in every member"], "yaml": ["python in yaml"]}
"""Wrappings that a reader of a format is most likely to open; a plain pickle for all others."""


class Case(NamedTuple):
    """One run.

    Attributes:
        command: name in the table of commands.
        family: file, plant or argument.
        target: name of the file, or of the output beside which something is planted.
        what: mutation or plant.
        seed: of its random parts.
    """

    command: str
    family: str
    target: str
    what: str
    seed: int

    def __str__(self) -> str:
        return "|".join(map(str, self))


def named_cases() -> list[Case]:
    """The cases that the environment names, one in a line."""
    named = []
    for line in os.environ.get(VARIABLE, "").splitlines():
        *parts, seed = line.split("|")
        named.append(Case(*parts, int(seed)))
    return named


def file_cases(bench: Workbench, count: int, quick: bool) -> Iterator[Case]:
    """Damage to files that verbs read, and things planted beside what they write."""
    names = names_in_turn(quick)
    for seed in range(count):
        rng = np.random.default_rng(seed)
        name = names[seed % len(names)]
        trace = bench.traces[name]
        outputs = [output for output in trace.outputs if not output.startswith(".")]
        if outputs and (not trace.reads or rng.random() < 0.25):
            yield Case(name, "plant", chosen(rng, outputs), chosen(rng, PLANTS), seed)
        elif trace.reads:
            file = chosen(rng, trace.reads)
            mutations = mutations_of(trace.kinds[file])
            if PurePosixPath(file).parent.as_posix() in own_folders(name):  # may lie on another disk
                mutations.remove("folder is a link")
            yield Case(name, "file", file, chosen(rng, mutations), seed)


def names_in_turn(quick: bool) -> list[str]:
    """Commands as often as they are tried; in the normal run, those that take seconds a quarter as often."""
    shares = {command.name: 1 if command.slow else 4 for command in COMMANDS}
    names = [name for turn in range(4) for name, share in shares.items() if turn < share]
    return names if quick else [command.name for command in COMMANDS]


def own_folders(command: str) -> set[str]:
    """Folders that a command writes into."""
    return {PurePosixPath(pattern).parent.as_posix() for pattern in BY_NAME[command].outputs}


def pickle_cases(bench: Workbench, each: bool) -> Iterator[Case]:
    """A pickle in every file that any verb reads; `each`: in all wrappings, by every command."""
    seen = set()
    for command in COMMANDS:
        for file, kind in bench.traces[command.name].kinds.items():
            if not each and file in seen:
                continue
            seen.add(file)
            fitting = (
                [name for name in PICKLES if name in mutations_of(kind)]
                if each
                else LIKELY.get(kind, ["pickle"])
            )
            for name in fitting:
                yield Case(command.name, "file", file, name, 0)


def argument_cases(count: int, quick: bool) -> Iterator[Case]:
    names = names_in_turn(quick)
    for seed in range(count):
        yield Case(names[seed % len(names)], "argument", "-", "drawn", seed)


def chosen(rng: np.random.Generator, names) -> str:
    return names[rng.integers(len(names))]


def prepared(case: Case, bench: Workbench, place: Place) -> tuple[list[str], Expected]:
    """Make the surroundings hostile; the words of the command, and what it may do."""
    command, trace = BY_NAME[case.command], bench.traces[case.command]
    words, more, planted, names = shlex.split(command.line), (), None, ()
    target = PurePosixPath(case.target)
    if case.family == "file":
        mutate(place.work / case.target, trace.kinds[case.target], case.what, place, case.seed)
        # Of two files that do not belong together, the other one may be named.
        names = (target.name, target.stem, *(part for part in target.parts[:-1]), "than the one given")
    elif case.family == "plant":
        name = plant(case.target, case.what, place)
        is_folder = any(other.startswith(f"{name}/") for other in trace.outputs)
        planted = (name, is_of_the_command(case.what) and not is_folder)
        names = (PurePosixPath(name).name, *target.parts)
    else:
        words, told = hostile_arguments.drawn(command.line, case.seed)
        more = hostile_arguments.may_write(words, command.line)
        out = hostile_arguments.out_of(words) or told
        names = (told[:15], repr(told[:15])[1:-1], "argument", PurePosixPath(out).name[:15] or told)
        given = [word for word in words if word not in shlex.split(command.line) and word.strip()]
        if told in words[:-1]:  # its value may be a word of the line, too
            given.append(words[words.index(told) + 1])
        names += tuple(word[:15] for word in given)
        names += tuple(word.lstrip("-").replace("-", "_") for word in given if word.startswith("--"))
        names += tuple(repr(word[:15])[1:-1] for word in given)
        names += tuple(one_line(word)[:12] for word in given)
        names += tuple(spelled for word in given for spelled in hostile_arguments.as_read(word))
        # `thresholds belong to ...` names --thresholds-mm too, and what is missing is named by its own flag.
        flags = [word for word in given if word.startswith("--")]
        names += tuple(part for flag in flags for part in flag.split("-") if len(part) > 4)
        names += ("Missing from", "Unrecognized options", "the command never reverses", "no data given")
        names += ("--out: name the folder",)
    return words, Expected(
        command, frozenset(trace.reads), frozenset(trace.outputs), more, planted, names, trace.cpu
    )


def run_case(case: Case, bench: Workbench, runner: Runner, by_console: bool = False) -> Verdict:
    """Run a case in a copy of the workbench, and judge it."""
    with one_place(bench.root) as place:
        words, expected = prepared(case, bench, place)
        before = snapshot.taken(place.around)
        ended = run(words, place, runner, by_console, expected)
        if ended.hangs and not by_console:
            return run_case(case, bench, runner, by_console=True)
        after = snapshot.taken(place.around)
        verdict = judge(ended, expected, place, before, after)
        if ended.code == 0 and not ended.stopped:
            changed = snapshot.differences(before, after)
            written = [
                name for name in changed if after.get(name, ("",))[0] == "file" and name.startswith("work/")
            ]
            (read,) = runner.run(
                job([], place, call="read_back:print_faults", arguments=[str(place.around), written])
            )
            verdict.faults += unread(read)
        if verdict.faults:
            verdict.outcome = "fault"
        return verdict


def run(words: list[str], place: Place, runner: Runner, by_console: bool, expected: Expected) -> Ended:
    fails = expected.command.fails
    if by_console and all("\0" not in word for word in words):
        return console(words, place, no_children=fails)
    most = max(MOST_CPU_SECONDS, 3 * expected.cpu)
    return runner.run(job(words, place, no_children=fails, most_cpu=most))[0]


@dataclass
class Tally:
    """Outcomes of many cases."""

    verdicts: dict[Case, Verdict]

    def table(self) -> str:
        """Counts by verb and outcome."""
        counts: dict[str, Counter[str]] = defaultdict(Counter)
        for case, verdict in self.verdicts.items():
            counts[BY_NAME[case.command].verb][verdict.outcome] += 1
        rows = [
            f"  {verb:<10} " + ", ".join(f"{name} {n}" for name, n in sorted(row.items()))
            for verb, row in counts.items()
        ]
        return "\n".join([f"{len(self.verdicts)} hostile runs:", *rows])

    def faults(self) -> dict[tuple[str, str], list[Case]]:
        """Cases by verb and fault, names and numbers left out, so that one fault is told once."""
        found = defaultdict(list)
        for case, verdict in self.verdicts.items():
            for fault in verdict.faults:
                found[BY_NAME[case.command].verb, alike(fault)].append(case)
        return found

    def report(self) -> str:
        """The table, and each fault once with how often it was seen and a case that shows it."""
        lines = [self.table()]
        for (verb, kind), cases in sorted(
            self.faults().items(), key=lambda item: (item[0][0], -len(item[1]))
        ):
            case = cases[0]
            text = next(fault for fault in self.verdicts[case].faults if alike(fault) == kind)
            lines.append(f"{len(cases)} x {verb}: {text}\n      {VARIABLE}={shlex.quote(str(case))}")
        return "\n".join(lines)


def alike(fault: str) -> str:
    return re.sub(r"0x[0-9a-f]+|[\d.]+|'.*'|\".*\"", "#", fault)[:90]


def run_all(cases: list[Case], bench: Workbench, runner: Runner) -> Tally:
    """Run cases, some at a time."""
    cases = named_cases() or cases[int(os.environ.get(FIRST, "0")) :]

    def one(numbered: tuple[int, Case]) -> Verdict:
        number, case = numbered
        verdict = run_case(case, bench, runner, by_console=number % CONTROL == CONTROL - 1)
        for fault in verdict.faults:  # at once: thousands take an hour
            print(f"{VARIABLE}={shlex.quote(str(case))}: {fault}", flush=True)
        return verdict

    verdicts = runner.each(one, list(enumerate(cases)))
    return Tally(dict(zip(cases, verdicts, strict=True)))
