"""Hostile values for every option of every verb; the options are those of the verb's dataclass."""

import dataclasses
import importlib
import shlex
from pathlib import Path

import numpy as np

NUMBERS = (
    "-1",
    "0",
    "nan",
    "inf",
    "-inf",
    "1e400",
    "1e-400",
    "1000000000",
    "1" + 30 * "0",
    "9" * 5000,
    "-1e18",
    "0.5",
    "0x10",
    "1_0",
    "\u0661",
)
WORDS = (
    "",
    " ",
    "x" * 5000,
    "two\nlines",
    "a\rb\x1b[31mred",
    "<b>bold</b>",
    "../../outside/precious.txt",
    "--out",
    "-",
    "--",
    "\udcff",
    "null",
    "{}",
    "=",
    "a=b",
    "preset=1=2",
    "[" * 2000,
)
PATHS = (
    ".", "..", "../outside", "../outside/precious.txt", "log.csv", "log.csv/inside", "data", "data/train",
    "data/dataset.json", "data/train/dataset.json", "data/train/episode_0000.mcap", "small.yaml",
    "recipe.yaml", "x" * 255, "x" * 300, "x/" * 200 + "x", "two\nlines.yaml", "a\x1b[31m.json", "<b>.html",
    "| `a` |", "no/such/folder", "/proc/none", "/dev/full", "/dev/null", "/dev/zero", "/sys/none",
    "coleman_hodgdon.json", "runs/ram/policy.onnx", "missing.yaml", "results", "--", "-", "~", "$HOME", "*",
    "CON", "a:b", "data/train/", "data//train",
)  # fmt: skip
ENDINGS = (".json", ".yaml", ".png", ".mp4", ".html", "")
SKIPPED = ("dask",)
"""Options that wait for another machine; their bad values are tried alone."""


def options_of(verb: str) -> list[str]:
    """Names of the fields of a verb's options."""
    module = importlib.import_module({"import": "scripts.import_log"}.get(verb, f"scripts.{verb}"))
    (options,) = [
        item
        for item in vars(module).values()
        if dataclasses.is_dataclass(item) and isinstance(item, type) and item.__module__ == module.__name__
    ]
    return [field.name for field in dataclasses.fields(options)]


def drawn(line: str, seed: int) -> tuple[list[str], str]:
    """Words of a command with one mistake, and what a message about it may name."""
    rng = np.random.default_rng(seed)
    words = shlex.split(line)
    name = options_of(words[0])[rng.integers(len(options_of(words[0])))]
    if name in SKIPPED:
        return [
            *words,
            "--dask",
            str(rng.choice(["nowhere", "tcp://", "tcp://127.0.0.1:1", "1:2:3", "http://x\ny"])),
        ], "--dask"
    flag = "--" + name.replace("_", "-")
    value = value_for(rng, flag, words)
    how = rng.random()
    if how < 0.1 and name not in ("only", "free"):  # everything is no mistake, and takes minutes
        return without_value(words, flag), flag
    if flag not in words and how < 0.3:  # a word that stands by itself
        return instead_of_positional(rng, words, value), value
    if how > 0.97:
        return [*words, f"{flag}s", value], flag
    return with_value(words, flag, value), flag


def value_for(rng: np.random.Generator, flag: str, words: list[str]) -> str:
    if flag == "--out" or rng.random() < 0.25:
        value = PATHS[rng.integers(len(PATHS))]
        if rng.random() < 0.3:
            value += ENDINGS[rng.integers(len(ENDINGS))]
        return value
    values = (*NUMBERS, *NUMBERS, *WORDS)
    return values[rng.integers(len(values))]


def with_value(words: list[str], flag: str, value: str) -> list[str]:
    if flag not in words:
        return [*words, flag, value]
    at = words.index(flag)
    return [*words[: at + 1], value, *words[at + 2 :]]


def without_value(words: list[str], flag: str) -> list[str]:
    if flag not in words:
        return [*words, flag]
    at = words.index(flag)
    return words[: at + 1] + words[at + 2 :]


def instead_of_positional(rng: np.random.Generator, words: list[str], value: str) -> list[str]:
    ends = next((at for at, word in enumerate(words) if word.startswith("--")), len(words))
    if ends <= 1:
        return [*words, value]
    at = int(rng.integers(1, ends))
    return [*words[:at], value, *words[at + 1 :]]


def as_read(word: str) -> tuple[str, ...]:
    """Ways to write a word once it is read as a path or a number; no lone letter, which any line has."""
    path = Path(word)
    spelled = [str(path)[:40], path.stem[:40], *(part[:40] for part in path.parts)]
    spelled.append(repr(path.stem[:40])[1:-1])
    try:
        spelled.append(f"{float(word):g} s")
        spelled.append(f"{float(word):g}")
    except ValueError:
        pass
    return tuple(text for text in spelled if len(text) > 1 or not text.isalnum())


def out_of(words: list[str]) -> str | None:
    """Target that `--out` names."""
    return words[words.index("--out") + 1] if "--out" in words[:-1] else None


def may_write(words: list[str], line: str) -> tuple[str, ...]:
    """Patterns of what a command with another `--out` may write in its working folder."""
    out = out_of(words)
    if out is None or out == out_of(shlex.split(line)) or out == ".." or out.startswith(("/", "../", "--")):
        return ()
    path = Path(out)
    name = path.as_posix()
    below = () if name == "." else (name,)
    parents = tuple(parent.as_posix() for parent in path.parents if parent.as_posix() != ".")
    prefix = "" if name == "." else f"{name}/"
    beside = path.with_suffix("").as_posix() if path.name else name
    return (
        *below,
        *parents,
        f"{prefix}*",
        f"{prefix}*/*",
        f"{prefix}*/*/*",
        f"{beside}.md",
        f"{beside}_fit.*",
    )
