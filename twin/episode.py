"""One episode as arrays: what was commanded, what was true, what a sensor saw. Time is the leading axis."""

import dataclasses
import html
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError, needs_extra

if TYPE_CHECKING:  # of extras
    from matplotlib.figure import Figure
    from pandas import DataFrame

Array = NDArray[np.float64]
Method = Literal["thin", "nearest", "interpolate"]  # method of `resample`
UNKNOWN: Array = np.empty(0)  # default of an angle of a `Record`: NaN throughout
LARGEST_GRID = 10_000_000
"""Samples of an even grid: more come of a wrong time stamp, and would fill the memory."""

WIRES = "abcd"  # names of the wires, by index: a against b in the first bending plane, c against d sideways
WIRE_PLACES = {"a": (0.0, 1.0), "b": (0.0, -1.0), "c": (1.0, 0.0), "d": (-1.0, 0.0)}  # across, (y, z)
WIRE_COLOURS = (0.83, 0.18, 0.13), (0.12, 0.38, 0.75), (0.16, 0.55, 0.28), (0.90, 0.58, 0.10)
OPTIONAL = ("pulley", "sheath_bend", "wire_slack", "lateral_pull", "lateral_bend", "lateral_joint_angle")
"""Fields of an episode that may be empty: not recorded, or not there in one bending plane."""
_COLUMNS = ("time", "pull_mm", "truth_deg", "measured_deg")  # of a `Record`
_LOOP_POINTS = 500  # of the small loop of a notebook, at most


def _empty() -> Array:
    return np.empty(0)


@dataclasses.dataclass(frozen=True)
class Episode:
    """N samples of one run of the twin (or of a measured log), in SI units.

    Wires are indexed a, b (, c, d) = 0, 1 (, 2, 3): pulling a positive distance pulls wire a and pays out
    wire b, pulling a positive lateral distance pulls wire c and pays out wire d. A field that may be empty is
    so where it was not recorded.

    Attributes:
        time: (N,) seconds since the start of the record.
        pull: (N,) commanded pulling distance [m].
        bend: (N,) true bending angle of the tip, in the plane of wires a and b [rad].
        measured_bend: (N,) bending angle as the sensor saw it [rad]; NaN where it is missing, the only field
            that may be.
        joint_angle: (N, vertebrae) angle of each hinge, base to tip [rad].
        wire_tension: (N, wires, elements + 1) tension in each length of wire, pulley to tip [N].
        sheath_friction: (N, wires, elements) largest friction force that each element of the sheath can
            exert [N].
        pulley: (N,) distance that the pulley has really pulled, after servo and backlash [m]; may be empty.
        sheath_bend: (N,) angle that the sheath is bent by [rad]; may be empty.
        wire_slack: (N, wires, elements + 1) how much longer each length of wire is than its path [m], pulley
            to tip; zero where it is taut; may be empty.
        lateral_pull: (N,) commanded pulling distance of wire c against d [m]; empty with one bending plane.
        lateral_bend: (N,) true bending angle of the tip, in the plane of wires c and d [rad]; empty with one
            bending plane.
        lateral_joint_angle: (N, vertebrae) angle of each sideways hinge, base to tip [rad]; empty with one
            bending plane.
        metadata: parameters, seed, signal and versions: what made this record.
        attachments: files kept with the record by name: the model and the configuration.
    """

    time: Array
    pull: Array
    bend: Array
    measured_bend: Array
    joint_angle: Array
    wire_tension: Array
    sheath_friction: Array
    pulley: Array = dataclasses.field(default_factory=_empty)
    sheath_bend: Array = dataclasses.field(default_factory=_empty)
    wire_slack: Array = dataclasses.field(default_factory=_empty)
    lateral_pull: Array = dataclasses.field(default_factory=_empty)
    lateral_bend: Array = dataclasses.field(default_factory=_empty)
    lateral_joint_angle: Array = dataclasses.field(default_factory=_empty)
    metadata: dict[str, Any] = dataclasses.field(default_factory=dict)
    attachments: dict[str, bytes] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse arrays that do not belong together; only a measurement may be NaN."""
        count = len(self.time)
        for field in [field.name for field in dataclasses.fields(self)[1:]]:
            values = getattr(self, field)
            if field in ("metadata", "attachments") or (field in OPTIONAL and len(values) == 0):
                continue
            if len(values) != count:
                raise InputError(f"{field} has {len(values)} samples, time has {count}")
            wrong = np.isinf(values) if field == "measured_bend" else ~np.isfinite(values)
            if wrong.any():
                raise InputError(f"{field} is not finite at sample {int(np.argwhere(wrong)[0][0])}")
        if count < 2:
            raise InputError(f"a record needs at least 2 samples, got {count}")
        if not np.isfinite(self.time).all() or not (np.diff(self.time) > 0).all():
            raise InputError("time must increase from sample to sample")

    def __repr__(self) -> str:
        missing = int(np.isnan(self.measured_bend).sum())
        recorded = [
            name + (f" ({missing} missing)" if name == "measured_bend" and missing else "")
            for name, values in self._arrays().items()
            if values.size and name not in ("time", "pull", "bend")
        ]
        seconds = float(self.time[-1] - self.time[0])
        pull, bend = self.pull_mm, self.truth_deg
        return (
            f"Episode {self._origin()}\n"
            f"  {len(self.time)} samples every {self.sample_time:g} s, {seconds:g} s; "
            f"pull {pull.min():.2f} to {pull.max():.2f} mm, bend {bend.min():.1f} to {bend.max():.1f} deg\n"
            f"  recorded: time, pull, bend, {', '.join(recorded)}"
        )

    def _repr_html_(self) -> str:
        """Return the text of `repr` next to a small loop, for notebooks."""
        rows = np.column_stack([self.pull, -self.bend])[:: -(-len(self.time) // _LOOP_POINTS)]
        rows = (rows - rows.min(axis=0)) / np.maximum(np.ptp(rows, axis=0), 1e-12)
        points = " ".join(f"{4 + 112 * x:.1f},{4 + 82 * y:.1f}" for x, y in rows.tolist())
        return (
            '<div style="display:flex;gap:1em"><svg width="120" height="90" style="flex:none" role="img">'
            "<title>bending angle over pulling distance</title>"
            f'<polyline points="{points}" fill="none" stroke="currentColor"/></svg>'
            f'<pre style="white-space:pre-wrap">{html.escape(repr(self))}</pre></div>'
        )

    @property
    def sample_time(self) -> float:
        """Median time between two samples [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def is_measured(self) -> bool:
        """True where a real endoscope left this record, not the twin."""
        return bool(self.metadata.get("source") == "measured")

    @property
    def pull_mm(self) -> Array:
        """(N,) commanded pulling distance in millimetres, the unit of the Coleman-Hodgdon parameters."""
        return self.pull * 1e3

    @property
    def truth_deg(self) -> Array:
        """(N,) true bending angle in degrees."""
        return np.degrees(self.bend)

    @property
    def measured_deg(self) -> Array:
        """(N,) measured bending angle in degrees, NaN where it is missing."""
        return np.degrees(self.measured_bend)

    @property
    def wire_names(self) -> str:
        """Names of the wires: c and d only where a second bending plane was recorded."""
        lateral = self.lateral_pull, self.lateral_bend, self.lateral_joint_angle
        return WIRES if any(values.size > 0 for values in lateral) else WIRES[:2]

    @property
    def tension(self) -> Array:
        """(N, wires) tension of the wires at the pulley, where a load cell would sit [N]."""
        return self.wire_tension[:, :, 0]

    def resampled(self, sample_time: float, method: Method | None = None) -> "Episode":
        """Episode at a sample time T [s]; see `resample` for the methods and what they refuse.

        By default a simulated episode is thinned and a measured one interpolated.
        """
        method = method or ("interpolate" if self.is_measured else "thin")
        columns = resample(self.time, self._arrays(), sample_time, method, with_gaps=("measured_bend",))
        return dataclasses.replace(self, **columns)

    def part(self, begin: int = 0, end: int | None = None) -> "Episode":
        """Return the samples from `begin` to before `end`, at their own times."""
        columns = {name: values[begin:end] for name, values in self._arrays().items()}
        return dataclasses.replace(self, **columns)

    def to_dataframe(self) -> "DataFrame":
        """Return a row for each sample: `time_s` and all recorded quantities, units in their names.

        The columns are those of `endotwin export --format csv --columns all`; `bend_deg` is the truth.
        """
        with needs_extra("Episode.to_dataframe"):
            import pandas
        from twin.recording.features import table_columns

        return pandas.DataFrame(table_columns(self, everything=True))

    def plot(self) -> "Figure":
        """Return a figure of the loop, and of bending angle and pull over time; a notebook shows it."""
        with needs_extra("Episode.plot"):
            from twin.report.figures import episode_figure
        return episode_figure(self)

    def record(self, number: int = 0) -> "Record":
        """Return the columns of an estimator [mm, deg]; the truth of a measured log is unknown.

        `number` names the episode where its metadata have neither a name nor a number.
        """
        facts = self.metadata
        low, high = facts.get("stroke_mm") or np.round([self.pull_mm.min(), self.pull_mm.max()], 1) + 0.0
        preset = "" if self.is_measured else self.preset_name
        return Record(
            time=self.time,
            pull_mm=self.pull_mm,
            truth_deg=np.full(len(self.time), np.nan) if self.is_measured else self.truth_deg,
            measured_deg=self.measured_deg,
            name=str(facts.get("name") or f"episode_{facts.get('episode', number):04}"),
            source=str(facts.get("twin") or ("measured" if self.is_measured else preset or "simulated")),
            preset=preset,
            stroke_mm=(float(low), float(high)),
        )

    @property
    def preset_name(self) -> str:
        """Name of the preset in the metadata; empty if they state none."""
        preset = self.metadata.get("preset")
        return str((preset.get("name") if isinstance(preset, Mapping) else preset) or "")

    def _origin(self) -> str:
        """Maker of the record, as far as its metadata state it."""
        facts = self.metadata
        preset = self.preset_name
        known = [f"{facts['name']!r}"] if facts.get("name") else []
        known += ["measured"] if self.is_measured else [f"of {preset}"] if preset else []
        known += [f"{name} {facts[name]}" for name in ("signal", "seed", "episode") if name in facts]
        return ", ".join(known) or "of unknown origin"

    def _arrays(self) -> dict[str, Any]:
        return {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if field.name not in ("metadata", "attachments")
        }


class Dataset(list[Episode]):
    """Episodes of a folder, in the order of their names."""

    def to_dataframe(self) -> "DataFrame":
        """Return a row of parameters for each episode: metadata, and `preset.NAME` in SI units."""
        with needs_extra("Dataset.to_dataframe"):
            import pandas
        facts = [{k: v for k, v in episode.metadata.items() if k != "statistics"} for episode in self]
        return pandas.json_normalize(facts)


@dataclasses.dataclass(frozen=True)
class Record:
    """N samples of a command and of an angle, in the units of estimators; time is the last axis.

    Leading axes hold records along the same times; a command that they share has length 1 there.

    Attributes:
        time: (N,) time [s].
        pull_mm: (..., N) commanded pulling distance [mm].
        truth_deg: (..., N) true bending angle, NaN where it is unknown [deg].
        measured_deg: (..., N) measured bending angle, NaN where it is missing [deg].
        name: name of the record in messages and tables.
        source: kind of twin, preset, or "measured".
        preset: name of the preset that simulated it; empty if unknown.
        stroke_mm: range of the pulling distance, requested or found [mm].
        estimates: (..., N) estimated bending angle by method [deg].
    """

    time: Array
    pull_mm: Array
    truth_deg: Array = dataclasses.field(default_factory=lambda: UNKNOWN)
    measured_deg: Array = dataclasses.field(default_factory=lambda: UNKNOWN)
    name: str = ""
    source: str = ""
    preset: str = ""
    stroke_mm: tuple[float, float] = (np.nan, np.nan)
    estimates: dict[str, Array] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        """Fill unknown angles with NaN, and refuse columns of different lengths."""
        shape = self.pull_mm.shape
        for name in ("truth_deg", "measured_deg"):
            if getattr(self, name) is UNKNOWN:
                object.__setattr__(self, name, np.broadcast_to(np.nan, shape))
        for name, values in self._arrays().items():
            if values.shape[-1] != len(self.time):
                raise InputError(f"{name} has {values.shape[-1]} samples, time has {len(self.time)}")

    @property
    def sample_time(self) -> float:
        """Median time between two samples [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def is_measured(self) -> bool:
        """True where a real endoscope left this record, not the twin."""
        return self.source == "measured"

    @property
    def reference_deg(self) -> Array:
        """(..., N) reference of scores: the truth; of a measured record, the measurement [deg]."""
        return self.measured_deg if self.is_measured else self.truth_deg

    @property
    def known(self) -> NDArray[np.bool_]:
        """(..., N) whether the reference is known."""
        return ~np.isnan(self.reference_deg)

    @property
    def filled_deg(self) -> Array:
        """(N,) reference, linear between its neighbours where it is unknown [deg]."""
        return without_holes(self.time, self.reference_deg)

    def error_deg(self, method: str) -> Array:
        """Return estimate minus reference (..., N) of a method [deg]; NaN where the reference is unknown."""
        if method not in self.estimates:
            raise InputError(f"no estimates of {method!r}; there are: {', '.join(self.estimates)}")
        return self.estimates[method] - self.reference_deg

    def part(self, begin: int = 0, end: int | None = None) -> "Record":
        """Return the samples from `begin` to before `end`, at their own times."""
        return self._with({name: values[..., begin:end] for name, values in self._arrays().items()})

    def resampled(self, sample_time: float, method: Method | None = None) -> "Record":
        """Record at a sample time T [s]; see `resample` for the methods and what they refuse.

        By default a simulated record is thinned and a measured one interpolated.
        """
        columns = {name: np.moveaxis(values, -1, 0) for name, values in self._arrays().items()}
        method = method or ("interpolate" if self.is_measured else "thin")
        gaps = [name for name, values in columns.items() if name == "measured_deg" or np.isnan(values).any()]
        found = resample(self.time, columns, sample_time, method, with_gaps=gaps)
        return self._with({name: np.moveaxis(values, 0, -1) for name, values in found.items()})

    def _arrays(self) -> dict[str, Array]:
        columns = {name: getattr(self, name) for name in _COLUMNS}
        return columns | {f"estimate of {method}": values for method, values in self.estimates.items()}

    def _with(self, columns: Mapping[str, Array]) -> "Record":
        own: dict[str, Any] = {name: columns[name] for name in _COLUMNS}
        estimates = {method: columns[f"estimate of {method}"] for method in self.estimates}
        return dataclasses.replace(self, estimates=estimates, **own)


def resample(
    time: Array,
    columns: Mapping[str, Array],
    sample_time: float,
    method: Method,
    *,
    with_gaps: Collection[str] = (),
) -> dict[str, Any]:
    """Columns (N, ...) at another sample time, `time` among them.

    Args:
        time: (N,) times, increasing [s].
        columns: arrays of N samples, or empty.
        sample_time: T [s].
        method: `thin` keeps every n-th sample, interpolates where T is no multiple of the median sample time,
            and refuses a T below it;
            `nearest` keeps every n-th, n being the integer nearest to their ratio and at least 1;
            `interpolate` is linear on an even grid from 0 on.
        with_gaps: columns with NaN where a value is missing. A grid point between two known values that are
            two sample times or more apart (of the grid or of the record, the longer one) is NaN, unless it
            coincides with one of them.

    Raises:
        ValueError: T does not fit, or the grid would have more than `LARGEST_GRID` samples.
    """
    own = float(np.median(np.diff(time)))
    ratio = sample_time / own
    step = max(round(ratio), 1) if np.isfinite(ratio) else 1
    if method == "thin" and not ratio > 1 - 1e-6:
        raise InputError(f"`sample_time` {sample_time:g} s: must be at least the record's {own:g} s")
    if method == "nearest" or (method == "thin" and abs(ratio - step) <= 1e-6 * ratio):
        return {name: values[::step] for name, values in columns.items()} | {"time": time[::step]}
    if not 0 < sample_time < np.inf:
        raise InputError(f"sample time {sample_time:g} s: must be positive")
    seconds = float(time[-1] - time[0])
    if seconds / sample_time > LARGEST_GRID:
        raise InputError(
            f"sample time {sample_time:g} s: a record of {seconds:g} s would be more than "
            f"{LARGEST_GRID} samples: choose a longer one, or check the record's time"
        )
    grid = np.arange(time[0], time[-1] + 1e-9, sample_time)
    reach = max(sample_time, own)
    found = {}
    for name, values in columns.items():
        if not len(values):
            found[name] = values
            continue
        rows = values.reshape(len(values), int(np.prod(values.shape[1:]))).T
        if name in with_gaps:
            even = [_with_gaps(time, row, grid, reach) for row in rows]
        else:
            even = [np.interp(grid, time, row) for row in rows]
        found[name] = np.array(even).T.reshape(len(grid), *values.shape[1:])
    return found | {"time": grid - grid[0]}


def _with_gaps(time: Array, values: Array, grid: Array, reach: float) -> Array:
    """(M,) values linear on a grid, NaN between known ones that are twice `reach` or more apart."""
    known = ~np.isnan(values)
    if not known.any():
        return np.full(len(grid), np.nan)
    time = time[known]
    place = np.searchsorted(time, grid)
    before, after = np.append(-np.inf, time)[place], np.append(time, np.inf)[place]
    rounding = 1e-6 * reach
    seen = after - before < 2 * (reach - rounding)
    seen |= np.minimum(grid - before, after - grid) <= rounding
    return np.where(seen, np.interp(grid, time, values[known]), np.nan)


def runs_of_true(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first sample of each run of True in a mask (N,), and the one after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def without_holes(time: Array, angle: Array) -> Array:
    """Return a measured angle (N,) with each NaN linear between its neighbours, level at the ends."""
    known = ~np.isnan(angle)
    if not known.any():
        raise InputError("no angle is measured: a measured record needs one")
    return np.where(known, angle, np.interp(time, time[known], angle[known]))
