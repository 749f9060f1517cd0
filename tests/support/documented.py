"""Commands and snippets of README, docs and `--help` as they are printed, and small sizes to run them at."""

import dataclasses
import importlib
import re
import shlex

from repository import REPOSITORY

from scripts.__main__ import VERBS
from scripts.command import MODULES
from scripts.help_text import split_examples

_FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^ *```", re.DOTALL | re.MULTILINE)
_INDENTED = re.compile(r"(?:^    .+\n)+", re.MULTILINE)
_INLINE = re.compile(r"`(endotwin [^`\n]+)`")
SHELL = {"", "sh"}
HELP = "endotwin VERB --help"
"""The examples of all verbs, as one document."""

TOGETHER = (
    "README.md",
    "docs/deployment.md",
    "docs/dataset.md",
    "docs/gate.md",
    "docs/method.md",
    "docs/ram_twins.md",
    "docs/benchmark/index.md",
    "docs/physics.md",
    "docs/control.md",
    "docs/results/paper_protocol.md",
    "docs/rendering.md",
    "docs/vision.md",
    HELP,
)
"""Documents whose commands go on from one another, in the order in which they are read, in one folder."""
ALONE = ("docs/quickstart.md",)
"""Documents that begin in a folder of their own."""

SMALLER: tuple[tuple[str, str], ...] = (
    (r"(endotwin generate .*--sensor stereo.*) --episodes \d+ --seconds \d+", r"\1 --episodes 1 --seconds 2"),
    (r"--seconds (60|40|30)\b", "--seconds 8"),
    (r"--seeds \d+", "--seeds 1"),
    (r"--trainings \d+", "--trainings 1"),
    (r"(endotwin generate mixed.yaml)", r"\1 --seconds 1"),
    (r"(endotwin generate --physics reduced) --episodes 64", r"\1 --episodes 2 --seconds 2"),
    (r"(endotwin train .*--protocol twins.*?)(?= --out)", r"\1 --episodes 1"),
    (r"(endotwin train data/train .*) --episodes 2000", r"\1 --episodes 2"),
    (r"(endotwin train .*--agent direct) --episodes 500", r"\1 --episodes 2"),
    (r"--starts \d+", ""),
    (r"--rivals [a-z -]*?(?= --)", "--rivals coleman-hodgdon"),
    (r"(endotwin calibrate .*?)(?= --out)", r"\1 --starts 1 --free section_stiffness pretension"),
    (r"(endotwin evaluate .*--suite paper)", r"\1 --methods C-H AM RAM"),
    (
        r"(--suite full .*--methods) (?:C-H AM AM-tuned|'RAM \(twins\)' 'RAM).*(?= --out)",
        r"\1 AM LSTM 'RAM (twins)' Ensemble",
    ),
    (
        r"(endotwin evaluate .*--suite (?:full|untrained))",
        r"\1 --seeds 1 --members 8 --seconds 5 --episodes 1 --sample-time 0.1",
    ),
    (
        r"(endotwin evaluate --suite sealed)",
        r"\1 --seeds 1 --members 8 --seconds 5 --methods 'RAM (twins)' AM Ensemble",
    ),
    (r"--sample-time 0.1 (.*)--sample-time 0.1", r"--sample-time 0.1 \1"),
    (r"(endotwin gate .*?)(?= --out)", r"\1 --quick"),
    (r"(endotwin run .*--stroke -1 1) < samples.jsonl", r"head -20 samples.jsonl | \1"),
    (r"--controller [a-z -]* oracle --seconds 20 --candidates 32", "--controller linear members-inverse"),
    (r"(endotwin control .*)--suite full", r"\1"),
    (
        r"(endotwin control .*?)(?= --out)",
        r"\1 --physics reduced --twins 1 --seconds 3 --candidates 1 --workers 1",
    ),
    (r"(endotwin control (?!.*--controller).*?)(?= --out)", r"\1 --controller linear members-inverse"),
    (r"--speed 4 --size 640 360 --fps 12", "--speed 8 --size 320 180 --fps 5"),
    (r"(endotwin render \S+ --out \S+\.mp4)", r"\1 --size 320 180 --speed 8 --fps 5"),
    (r"TrackingTraining\(seed=1\)", "TrackingTraining(64, horizon=32, environments=2, minibatch=32, seed=1)"),
)
"""Changes that make a long command a short one of the same kind; every other word stays as it is printed."""

NOT_RUN = {
    "make ": "the tests are one of them; `make demo` is run by `make validate`",
    "cc ": "tests/scripts/test_run_examples.py compiles and runs it",
    "./run_stream": "the same",
    "python docs/examples/run_stream.py": "the same",
    "python docs/examples/tcp_server.py": "tests/scripts/test_bridges.py runs it",
    "endotwin demo": "minutes: tests/scripts/test_demo.py runs it",
    "endotwin benchmark": "`make benchmark` runs it, in an hour",
    "endotwin view": "serves until it is stopped: tests/scripts/test_view_browser.py opens it",
    "--dask tcp://": "names a cluster: tests/workers/test_dask_cluster.py runs on one",
    "python -m scripts.studies.match_paper": "an hour: tests/studies/test_match_paper.py runs a small one",
    "python -m scripts.studies.ablation": "half an hour: tests/studies/test_ablation.py runs a small one",
}
"""Lines that are printed and not run here, by a part of them, and why."""


@dataclasses.dataclass(frozen=True)
class Snippet:
    """A command, or Python, of a document.

    Attributes:
        document: where it is printed.
        line: number there.
        text: as printed, without its comment.
        language: `sh` or `python`.
    """

    document: str
    line: int
    text: str
    language: str = "sh"

    @property
    def name(self) -> str:
        return f"{self.document}:{self.line}"

    @property
    def small(self) -> str:
        """The same at a small size."""
        text = self.text
        for pattern, smaller in SMALLER:
            text = re.sub(pattern, smaller, text)
        return text

    @property
    def is_run(self) -> bool:
        return not any(part in self.text for part in NOT_RUN)


def options_of(verb: str) -> type:
    """The dataclass of options of a verb."""
    return importlib.import_module(f"scripts.{MODULES.get(verb, verb)}").main.args[0]


def documents() -> list[str]:
    """Every document that a reader may take commands from, but `HELP`."""
    docs = sorted(str(path.relative_to(REPOSITORY)) for path in (REPOSITORY / "docs").rglob("*.md"))
    return ["README.md", "CONTRIBUTING.md", *(name for name in docs if not name.startswith("docs/site"))]


def snippets(document: str) -> list[Snippet]:
    """Commands and Python of a document, in its order."""
    if document == HELP:
        commands = [command for verb in VERBS for command in split_examples(options_of(verb))[1]]
        return [Snippet(HELP, number, command) for number, command in enumerate(commands, start=1)]
    text = (REPOSITORY / document).read_text()
    found = []
    for block in _FENCE.finditer(text):
        line = text[: block.start()].count("\n") + 2
        indent, language, body = block[1], block[2], block[3]
        if language == "python":
            code = "\n".join(part.removeprefix(indent) for part in body.splitlines())
            found.append(Snippet(document, line, code + "\n", "python"))
        elif language in SHELL:
            found += _commands(document, line, body)
    outside = _FENCE.sub(lambda block: "\n" * block[0].count("\n"), text)
    for block in _INDENTED.finditer(outside):
        found += _commands(document, outside[: block.start()].count("\n") + 1, block[0])
    return sorted(found, key=lambda snippet: snippet.line)


def inline_commands(document: str) -> list[str]:
    """Commands within sentences, which may be parts of one."""
    return _INLINE.findall(_FENCE.sub("", (REPOSITORY / document).read_text()))


def words_of(command: str) -> list[str]:
    """The words of a command, without its redirections."""
    words = shlex.split(command, comments=True)
    plain, skip = [], False
    for word in words:
        if word in ("<", ">", "|"):
            skip = True
        elif skip:
            skip = False
        else:
            plain.append(word)
    return plain


def _commands(document: str, first: int, body: str) -> list[Snippet]:
    found = []
    for number, line in enumerate(body.splitlines()):
        text = re.sub(r"(?<=\S)\s+#\s.*$", "", line.strip())
        if re.match(r"(endotwin|make|cc|python|\./run_stream)\b", text):
            found.append(Snippet(document, first + number, text))
    return found
