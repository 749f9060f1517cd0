"""Self-contained HTML pages made of parts: text, tables, facts, figures, folded details, commands, a player.

A part is a function that returns HTML as `Markup`; every text is escaped, unless it is `Markup` itself.
`Page.write` puts parts under headings into `assets/page.html.j2`: one file that loads nothing else.
"""

import base64
import dataclasses
import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup
from matplotlib.figure import Figure

from twin.errors import InputError
from twin.files.assets import assets_folder
from twin.files.atomic import write_whole
from twin.files.bounded import MEBIBYTE, read_limited
from twin.files.origin import Origin
from twin.files.shown import cut
from twin.report.figures import to_svg

LARGEST_PICTURE = 16 * MEBIBYTE  # size that is read of a picture [bytes]
WIDE, DOTS = 6.7, 200
"""Width from which letters of a figure are too small on a narrow screen, which then scrolls it [inches]; and
the dots of pictures [1 / inch]."""
MOST_FACTS = 200  # facts that a page lists of one file
Facts = Sequence[tuple[str, str]]  # names and values


@dataclasses.dataclass
class Page:
    """A page: parts under headings, with a table of contents."""

    kind: str  # what is reported, in a line above the title
    title: str  # heading of the page
    verb: str = "report"  # command that writes it
    verdict: str = ""  # word in large letters above the title; empty for none
    intro: tuple[Markup, ...] = ()  # parts between the title and the table of contents
    sections: list[tuple[str, tuple[Markup, ...]]] = dataclasses.field(default_factory=list)

    def add(self, heading: str, *parts: Markup) -> None:
        """Add a section."""
        self.sections.append((heading, parts))

    def add_origin(self, lines: Sequence[str], stated: Mapping[str, Facts], sentence: str = "") -> None:
        """Add the last section: the commands that repeat the result and, folded, what it was made from."""
        parts = [text(sentence)] if sentence else []
        parts += [commands(lines), folded("Settings, versions and data", facts(stated))]
        self.add("How to repeat it", *parts)

    def write(self, path: Path) -> Path:
        """Write the page as one HTML file."""
        environment = jinja2.Environment(
            loader=jinja2.FileSystemLoader(assets_folder()),
            autoescape=True,
            undefined=jinja2.StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        sections = [
            (re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-"), heading, parts)
            for heading, parts in self.sections
        ]
        shown = [*self.intro, *(part for _, parts in self.sections for part in parts)]
        has_player = any('class="player"' in part for part in shown)
        template = environment.get_template("page.html.j2")
        write_whole(path, template.render(page=self, sections=sections, has_player=has_player))
        return path


@dataclasses.dataclass(frozen=True)
class Cell:
    """Cell with small lines below its text, or a style: `best`, `mark yes`, `mark no`, `mark open`."""

    text: str
    small: tuple[str, ...] = ()
    style: str = ""


def text(sentence: str, style: str = "") -> Markup:
    """Return a paragraph; styles are `note`, `gap` and `claim`."""
    return Markup("<p{}>{}</p>").format(_class(style), sentence)


def bullets(lines: Iterable[str]) -> Markup:
    """Return a list."""
    return Markup('<ul class="lines">{}</ul>').format(_each("<li>{}</li>", lines))


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    title: str = "",
    note: str = "",
    cards: bool = False,
    numbers: bool = False,
) -> Markup:
    """Return a table; `cards` turns its rows into cards on a narrow screen, `numbers` aligns to the right."""
    style = f"{'numbers' if numbers else ''} {'cards' if cards else ''}".strip()
    lines = (
        Markup("<tr>{}</tr>\n").format(
            Markup("").join(
                _cell(value, name, "td" if column else 'th scope="row"')
                for column, (name, value) in enumerate(zip(head, row, strict=True))
            )
        )
        for row in rows
    )
    return Markup(
        '{}<div class="scroll" tabindex="0" role="group" aria-label="{}">\n<table{}>\n'
        "<thead><tr>{}</tr></thead>\n<tbody>\n{}</tbody>\n</table>\n</div>\n{}"
    ).format(
        Markup("<h3>{}</h3>\n").format(title) if title else "",
        title or "Table",
        _class(style),
        _each('<th scope="col">{}</th>', head),
        Markup("").join(lines),
        text(note, "note") if note else "",
    )


def _cell(value: object, label: str, tag: str) -> Markup:
    cell = value if isinstance(value, Cell) else Cell(str(value))
    return Markup('<{} data-label="{}"{}>{}{}</{}>').format(
        Markup(tag),
        label,
        _class(cell.style),
        cell.text,
        _each("<small>{}</small>", cell.small),
        Markup(tag[:2]),
    )


def facts(groups: Mapping[str, Facts]) -> Markup:
    """Return names and values in groups, by the titles of the groups."""
    sections = (
        Markup("<section>{}<dl>{}</dl></section>\n").format(
            Markup("<h3>{}</h3>").format(title) if title else "",
            Markup("\n").join(Markup("<dt>{}</dt><dd>{}</dd>").format(*entry) for entry in entries),
        )
        for title, entries in groups.items()
    )
    return Markup('<div class="facts">\n{}</div>').format(Markup("").join(sections))


def figure(
    image: Figure | Path | bytes, caption: str, alternative: str = "", narrow: Figure | None = None
) -> Markup:
    """Return a matplotlib figure, or a PNG or SVG picture or file, with its caption.

    A narrow screen shows `narrow` instead, where there is one; else it scrolls a wide figure.
    """
    style = ""
    if isinstance(image, Figure):
        address, wide = _svg_address(image), image.get_figwidth() > WIDE
    else:
        content = image if isinstance(image, bytes) else read_limited(image, LARGEST_PICTURE)
        kind, wide = "svg+xml" if content.startswith(b"<svg ") else "png", True
        if kind == "png":
            if not content.startswith(b"\x89PNG\r\n\x1a\n"):
                raise InputError("it is no PNG picture")
            pixels = int.from_bytes(content[16:20], "big")
            wide, style = pixels > WIDE * DOTS, f"max-width: {pixels // 2}px"
        address = data_address(f"image/{kind}", content)
    inner = Markup('<img alt="{}" src="{}"{}>').format(
        alternative or caption, address, Markup(' style="{}"').format(style) if style else ""
    )
    if narrow is not None:
        choice = '<picture><source media="(max-width: 40rem)" srcset="{}">{}</picture>'
        inner, wide = Markup(choice).format(_svg_address(narrow), inner), False
    elif wide:
        label = "Figure, wider than a narrow screen"
        scroll = '<div class="scroll" tabindex="0" role="group" aria-label="{}">{}</div>'
        inner = Markup(scroll).format(label, inner)
    return captioned(inner, caption, "pan" if wide else "" if narrow else "narrow")


def _svg_address(image: Figure) -> str:
    return data_address("image/svg+xml", to_svg(image).encode())


def film(content: bytes, caption: str) -> Markup:
    """Return an MP4 film with its caption."""
    video = '<video controls loop muted playsinline preload="auto" aria-label="{}" src="{}"></video>'
    return captioned(Markup(video).format(caption, data_address("video/mp4", content)), caption)


def captioned(inner: Markup, caption: str, style: str = "") -> Markup:
    """Return HTML as a figure with a number and a caption."""
    frame = "<figure{}>\n{}\n<figcaption>{}</figcaption>\n</figure>"
    return Markup(frame).format(_class(style), inner, caption)


def data_address(kind: str, data: bytes) -> str:
    """Return bytes as a `data:` address."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def gap(sentence: str, command: str = "") -> Markup:
    """Return a note that something is missing, and the command that makes it."""
    makes = Markup(" This makes it: <code>{}</code>").format(command) if command else ""
    return text(Markup("{}{}").format(sentence, makes), "gap")


def of_file(path: Path, show: Callable[[Path], Sequence[Markup]]) -> Sequence[Markup]:
    """Return what shows a file, or a note that it is missing or damaged."""
    if not path.is_file():
        return [gap(f"There is no {path.name} with these results.")]
    try:
        return show(path)
    except InputError as error:
        return [gap(f"{path.name} cannot be shown: {cut(error, 300)}.")]


def commands(lines: Sequence[str]) -> Markup:
    """Return commands as they are typed."""
    return Markup('<pre tabindex="0">{}</pre>').format("\n".join(lines))


def folded(summary: str, *parts: Markup) -> Markup:
    """Return parts that are shown when their summary is opened; a printed page shows them."""
    inner = Markup("\n").join(parts)
    return Markup("<details>\n<summary>{}</summary>\n{}\n</details>").format(summary, inner)


def side_by_side(*parts: Markup) -> Markup:
    """Return parts next to each other, below one another on a narrow screen."""
    return Markup('<div class="pair">\n{}</div>').format(_each("<div>{}</div>\n", parts))


def _class(style: str) -> Markup:
    return Markup(' class="{}"').format(style) if style else Markup("")


def _each(element: str, values: Iterable[str]) -> Markup:
    return Markup("").join(Markup(element).format(value) for value in values)


def origin_facts(origin: Origin | None) -> dict[str, Facts]:
    """Return versions and hashes of the data as groups of facts; none where a file states no origin."""
    if origin is None:
        return {}
    groups: dict[str, Facts] = {"Versions": tuple(origin.versions.items())}
    if origin.data:
        groups["Data, by SHA-256"] = [(data.path, data.sha256) for data in origin.data]
    return groups


def origin_command(origin: Origin | None, out: str) -> tuple[str, ...]:
    """Return the command that repeats a result at a place; none where its file states no origin."""
    return () if origin is None else (f"{origin.command} --out {shlex.quote(out)}",)


def flat_facts(values: Mapping[str, Any], prefix: str = "") -> Facts:
    """Return names and values of nested mappings; of a list of mappings, or of files, its length."""
    entries: list[tuple[str, str]] = []
    for key, value in values.items():
        name = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, dict):
            entries += flat_facts(value, f"{name}, ")
        elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
            entries.append((name, f"{len(value)}"))
        else:
            shown = _fact(value)
            entries.append((name, shown[1:-1] if isinstance(value, list) else shown))
    return entries[:MOST_FACTS]


def _fact(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_fact, value))}]"
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    return f"{value:.6g}" if isinstance(value, float) else cut(value, 300)
