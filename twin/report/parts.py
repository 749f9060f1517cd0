"""Parts of a page: text, pictures, tables, facts and commands, of which the page of every run is made.

A part is plain data; `assets/page.html.j2` draws each by its `kind`. Text is escaped there, unless it is
`Markup`, which only this program writes.
"""

import base64
import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from markupsafe import Markup
from matplotlib.figure import Figure

from twin.errors import InputError
from twin.files.atomic import write_whole
from twin.files.bounded import MEBIBYTE, read_limited
from twin.report.figures import to_svg
from twin.report.template import page_environment

LARGEST_PICTURE = 16 * MEBIBYTE
"""Size that is read of a picture [bytes]."""
WIDE = 6.7
"""Width from which letters of a figure would be too small on a narrow screen [inches]."""
PNG, MP4 = b"\x89PNG\r\n\x1a\n", b"ftyp"
"""First bytes of the two kinds of file; those of MP4 follow the length of its first part."""


@dataclasses.dataclass(frozen=True)
class Text:
    """A paragraph.

    Attributes:
        text: plain, or markup of this program.
        style: class of the paragraph; empty for an ordinary one.
    """

    kind: ClassVar = "text"
    text: str | Markup
    style: str = ""


@dataclasses.dataclass(frozen=True)
class Lines:
    """A list.

    Attributes:
        lines: one entry each.
    """

    kind: ClassVar = "lines"
    lines: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Picture:
    """A picture or a film, with a sentence that says what it shows.

    Attributes:
        source: a `data:` address.
        caption: below it.
        alternative: text in its place, for who cannot see it; the caption, if empty.
        style: `narrow`; `pan`, where a narrow screen shows a part of it at a time; or empty.
        is_film: whether it is a film.
        narrow: `data:` address of the picture on a narrow screen; the same one, if empty.
    """

    kind: ClassVar = "picture"
    source: str
    caption: str
    alternative: str = ""
    style: str = ""
    is_film: bool = False
    narrow: str = ""


@dataclasses.dataclass(frozen=True)
class Cell:
    """A cell of a table that says more than one thing, or stands out.

    Attributes:
        text: what it says.
        small: below it, in small letters.
        style: class of the cell; empty for an ordinary one.
    """

    text: str
    small: tuple[str, ...] = ()
    style: str = ""


@dataclasses.dataclass(frozen=True)
class Table:
    """A table; on a narrow screen each row becomes a card, where `cards` says so.

    Attributes:
        head: of each column.
        rows: one cell for each column.
        title: above it; empty for none.
        note: below it; empty for none.
        cards: for tables of many or wordy columns: cards on a narrow screen.
        style: class of the table; empty for an ordinary one.
    """

    kind: ClassVar = "table"
    head: tuple[str, ...]
    rows: tuple[tuple[str | Cell, ...], ...]
    title: str = ""
    note: str = ""
    cards: bool = False
    style: str = ""


@dataclasses.dataclass(frozen=True)
class Facts:
    """Names and values, in groups.

    Attributes:
        groups: each a title and its (name, value).
    """

    kind: ClassVar = "facts"
    groups: tuple[tuple[str, tuple[tuple[str, str], ...]], ...]


@dataclasses.dataclass(frozen=True)
class Gap:
    """Something that the run does not hold, and the command that makes it.

    Attributes:
        sentence: names it.
        command: makes it.
    """

    kind: ClassVar = "gap"
    sentence: str
    command: str = ""


@dataclasses.dataclass(frozen=True)
class ShownCommands:
    """ShownCommands, one a line, as they are typed.

    Attributes:
        lines: of a shell.
    """

    kind: ClassVar = "commands"
    lines: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Player:
    """A record that a slider goes through: pose, loop and time, drawn in the page itself.

    Attributes:
        pose: SVG of the endoscope, at the moment of its largest bend.
        loop: SVG of the loop.
        samples: what the script of the page moves them by.
        caption: below it.
        alternative: text in its place.
    """

    kind: ClassVar = "player"
    pose: Markup
    loop: Markup
    samples: dict[str, Any]
    caption: str
    alternative: str


@dataclasses.dataclass(frozen=True)
class SideBySide:
    """Parts side by side, one below the other on a narrow screen.

    Attributes:
        parts: of any kind.
    """

    kind: ClassVar = "beside"
    parts: tuple[Any, ...]


@dataclasses.dataclass(frozen=True)
class Folded:
    """Parts that are shown when their line is opened; a printed page shows them.

    Attributes:
        summary: the line.
        parts: of any kind.
    """

    kind: ClassVar = "folded"
    summary: str
    parts: tuple[Any, ...]


Part = Text | Lines | Picture | Table | Facts | Gap | ShownCommands | Player | SideBySide | Folded


@dataclasses.dataclass(frozen=True)
class Section:
    """A section of a page.

    Attributes:
        title: its heading, and its line in the table of contents.
        parts: in order.
    """

    title: str
    parts: tuple[Part, ...]

    @property
    def anchor(self) -> str:
        """Name that the table of contents links to."""
        return re.sub(r"[^a-z0-9]+", "-", self.title.lower()).strip("-")


@dataclasses.dataclass(frozen=True)
class Page:
    """The page of a run.

    Attributes:
        verb: that made it, as in `report`.
        kicker: what kind of page it is, in a line.
        title: its heading.
        headline: what a reader should take away, in one sentence.
        sections: in order.
        before: parts between the headline and the table of contents.
        verdict: a word in large letters before the headline; empty for none.
    """

    verb: str
    kicker: str
    title: str
    headline: str
    sections: tuple[Section, ...]
    before: tuple[Part, ...] = ()
    verdict: str = ""


def write_page(page: Page, path: Path) -> Path:
    """Write a page as one HTML file that loads nothing, whole or not at all."""
    players = any(part.kind == "player" for section in page.sections for part in section.parts)
    text = page_environment().get_template("page.html.j2").render(page=page, players=players)
    write_whole(path, text)
    return path


def drawn(figure: Figure, caption: str, alternative: str = "", narrow: Figure | None = None) -> Picture:
    """Return a figure as a picture of the page.

    Args:
        figure: to draw.
        caption: below it.
        alternative: text in its place; the caption, if empty.
        narrow: the same for a narrow screen; without it, a wide figure is panned there.
    """
    wide, on_narrow = figure.get_figwidth() > WIDE, "" if narrow is None else _svg_address(narrow)
    style = "" if wide and narrow else "pan" if wide else "narrow"
    return Picture(_svg_address(figure), caption, alternative, style, narrow=on_narrow)


def _svg_address(figure: Figure) -> str:
    return data_address("image/svg+xml", to_svg(figure).encode())


def png_picture(path: Path, caption: str, alternative: str = "", style: str = "pan") -> Picture:
    """Return a PNG file as a picture of the page.

    Raises:
        ValueError: it is no PNG picture, or too large.
        FileNotFoundError: there is none.
    """
    content = read_limited(path, LARGEST_PICTURE)
    if not content.startswith(PNG):
        raise InputError("it is no PNG picture")
    return Picture(data_address("image/png", content), caption, alternative, style)


def data_address(kind: str, data: bytes) -> str:
    """Return bytes as a `data:` address."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def repeat_section(commands: Sequence[str], sentence: str = "") -> Section:
    """Return the last section of every page: the commands that make the run and the page again."""
    said = (Text(sentence),) if sentence else ()
    return Section("How to repeat it", (*said, ShownCommands(tuple(commands))))
