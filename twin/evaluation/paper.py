"""Published figures of the RAM paper: Table II (Gaussian noise) and Table III (Poisson noise).

The columns are, from the left, the static model, the active model, the LSTM and the proposed method; a method
declares its column (`Presentation.paper_column`).

The static model cannot depend on the noise of a sensor that it does not read, yet the paper's C-H column
varies, and its rows at R = 1 and lambda = 2 are equal: they are quoted here as printed.
"""

import dataclasses

from twin.estimation.registry import method_spec
from twin.evaluation.protocol import SEALED
from twin.signals.noise import SENSORS

INSTRUMENT = "ureteroscope"
"""Preset of the paper's instrument: its figures are shown only with results on its records."""
INDICES = ("mae_deg", "rmse_deg", "md_deg", "var_deg2")


@dataclasses.dataclass(frozen=True)
class PaperTable:
    """One of the paper's tables of results."""

    number: str  # in the paper
    noise: str  # kind of the measurement noise, as in `evaluation.json`
    symbol: str  # of the noise level, in the paper
    values: dict[float, dict[str, tuple[float, float, float, float]]]  # by level and index, for each column


TABLES = (
    PaperTable(
        number="II",
        noise="gaussian",
        symbol="R",
        values={
            1.0: {
                "mae_deg": (4.4908, 2.2051, 1.9702, 0.4431),
                "rmse_deg": (5.4441, 2.8922, 2.4905, 0.6354),
                "md_deg": (2.5763, 2.2200, 1.9698, 0.4445),
                "var_deg2": (9.6637, 8.3489, 6.2010, 0.4030),
            },
            5.0: {
                "mae_deg": (6.6851, 4.3098, 2.3332, 0.7961),
                "rmse_deg": (8.7325, 4.9759, 2.8856, 1.0444),
                "md_deg": (4.8376, 4.3393, 2.3970, 0.7807),
                "var_deg2": (12.2948, 10.7782, 6.3925, 1.0110),
            },
        },
    ),
    PaperTable(
        number="III",
        noise="poisson",
        symbol="λ",
        values={
            0.1: {
                "mae_deg": (2.6982, 0.6422, 1.8049, 0.2768),
                "rmse_deg": (3.7738, 1.0049, 2.2945, 0.4720),
                "md_deg": (2.3647, 0.6612, 1.7987, 0.2796),
                "var_deg2": (7.7231, 0.9913, 1.8200, 0.2122),
            },
            1.0: {
                "mae_deg": (3.5428, 1.8271, 2.1294, 1.0388),
                "rmse_deg": (4.5736, 2.5454, 2.6640, 1.2125),
                "md_deg": (2.4925, 1.7836, 1.9693, 0.4549),
                "var_deg2": (8.7495, 5.2481, 2.0690, 0.3970),
            },
            2.0: {
                "mae_deg": (4.4908, 2.7163, 2.7476, 2.0156),
                "rmse_deg": (5.4441, 3.5148, 3.3603, 2.1334),
                "md_deg": (2.5763, 2.2095, 2.1578, 0.5354),
                "var_deg2": (9.6637, 8.0237, 2.4385, 0.4887),
            },
        },
    ),
)


def paper_value(noise: str, level: float, method: str, index: str) -> float | None:
    """Return one published figure under a noise, or None where the paper has none; see `INDICES`."""
    spec = method_spec(method)
    if spec is None or spec.presentation.paper_column is None or index not in INDICES:
        return None
    for table in TABLES:
        if table.noise == noise and level in table.values:
            return table.values[level][index][spec.presentation.paper_column]
    return None


def noise_label(noise: str, level: float) -> str:
    """Return a noise as people write it: `Gaussian, R = 1 deg²`, `Poisson, λ = 0.1`."""
    if noise == "salt-and-pepper":
        return f"Outliers, {100 * level:g} %"
    if noise == SEALED:
        return f"{level:g} sealed conditions"
    if noise in SENSORS:
        return SENSORS[noise].label.format(level)
    kind, _, variant = noise.partition("-")
    if kind == "poisson":
        return f"Poisson{' ' + variant if variant else ''}, λ = {level:g}"
    return f"{noise.capitalize()}, R = {level:g} deg²"
