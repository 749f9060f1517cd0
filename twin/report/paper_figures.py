"""The paper's Figs. 5 to 10 drawn from our tracks, each RMSE in the legend beside the published one."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from twin.estimation.registry import method_specs
from twin.evaluation.paper import noise_label
from twin.evaluation.score import Score
from twin.evaluation.track import Track
from twin.report.figures import tracking_figure
from twin.report.narrow import narrow_tracking_figure
from twin.report.tables import protocol_scores

FIGURES = (
    (5, "gaussian", 1.0),
    (6, "gaussian", 1.0),
    (7, "gaussian", 5.0),
    (8, "poisson", 0.1),
    (9, "poisson", 1.0),
    (10, "poisson", 2.0),
)
"""Number in the paper, noise and level; a method declares in which it is shown."""


def paper_figures(
    tracks: Sequence[Track], scores: Sequence[Score] = (), *, narrow: bool = False
) -> dict[int, tuple[Figure, str]]:
    """Return figures with captions, by their numbers in the paper; what the tracks have not is left out.

    Args:
        tracks: one for each noise, from `evaluate`.
        scores: of the records that the tracks are from; their RMSE goes into the legend.
        narrow: draw them for a narrow screen.
    """
    by_noise = {(track.noise, track.level): track for track in tracks}
    by_method = {(*score.condition, score.method): score for score in protocol_scores(scores)}
    figures = {}
    for number, noise, level in FIGURES:
        track = by_noise.get((noise, level))
        wanted = [spec.name for spec in method_specs() if number in spec.presentation.paper_figures]
        methods = [method for method in wanted if track is not None and method in track.estimates]
        if track is None or not methods:
            continue
        notes = {}
        for method in methods:
            score = by_method.get((noise, level, method))
            if score is not None:
                published = score.paper_rmse_deg
                beside = "" if published is None else f" (paper {published + 1e-9:.2f})"
                notes[method] = f"{score.rmse_deg:.2f}{beside}"
        label = noise_label(noise, level)
        caption = f"As the paper's Fig. {number}: {', '.join(methods)} under {label}."
        if notes:
            caption += " In the legend: RMSE over all test records and seeds [deg]."
        draw = narrow_tracking_figure if narrow else tracking_figure
        figures[number] = (draw(track, methods, label, notes), caption)
    return figures
