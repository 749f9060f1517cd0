"""The page of an evaluation: every method under every noise, beside the paper's figures where it has some."""

from pathlib import Path

from twin.errors import InputError
from twin.evaluation.ranking import rankings_of
from twin.evaluation.score import read_evaluation
from twin.files.origin import stated_origin
from twin.files.shown import cut
from twin.report.evaluation_parts import group_parts, result_parts, tracking_parts
from twin.report.facts import flat_facts, origin_command, origin_groups
from twin.report.headline import evaluation_headline
from twin.report.parts import Facts, Gap, Page, Part, Section, repeat_section


def evaluation_page(path: Path) -> Page:
    """Return the page of an `evaluation.json`, and of the tracks beside it.

    Raises:
        ValueError: it is damaged, or has no rows.
    """
    scores, contents = read_evaluation(path)
    origin = stated_origin(contents)
    sections = [Section("Results", result_parts(scores))]
    groups = group_parts(scores, rankings_of(contents))
    if groups:
        sections.append(Section("Every kind of record", groups))
    sections.append(Section("Tracking", _tracking(path.with_name("tracks.npz"))))
    protocol = tuple(flat_facts(contents["protocol"]))
    sections.append(Section("What was run", (Facts((("Protocol", protocol), *origin_groups(origin))),)))
    commands = origin_command(origin, str(path.parent)) or ("endotwin evaluate --help",)
    sections.append(repeat_section((*commands, f"endotwin report {path.parent}")))
    return Page(
        verb="report",
        kicker="EndoTwin evaluation: how well is the bending angle estimated?",
        title="Estimators under noise",
        headline=evaluation_headline(scores),
        sections=tuple(sections),
    )


def _tracking(path: Path) -> tuple[Part, ...]:
    if not path.is_file():
        return (Gap(f"There is no {path.name} beside these results."),)
    try:
        return tracking_parts(path)
    except InputError as error:
        return (Gap(f"{path.name} cannot be shown: {cut(error, 300)}."),)
