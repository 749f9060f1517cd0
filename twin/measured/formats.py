"""Logs that are no text: arrays of NumPy and MATLAB, Parquet, Excel, bags of ROS and MCAP files of others."""

import csv
import dataclasses
import tempfile
import zipfile
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import InputError, MissingFileError
from twin.files.bounded import MEBIBYTE, sha256_of
from twin.measured.table import MOST_ROWS, Column, CsvTable, column_names, read_columns
from twin.recording.reader import named_errors

Array = NDArray[np.float64]
BAGS = (".bag", ".db3", ".mcap")
FORMATS = (".npz", ".mat", ".parquet", ".xlsx", *BAGS)
"""Endings of the files that are read; all others are text. A folder is a bag of ROS 2."""
MOST_BYTES = 1024 * MEBIBYTE  # of the columns that are read
_MOST_FIELDS = 1000


def read_table(
    path: Path, names: Collection[str] | None, *, times: Collection[str] = (), no_header: bool = False
) -> CsvTable:
    """Read the columns of some names that a log has, or all; see `table.read_columns` for text.

    Lines of the table are rows, from 1, where the file is no text.
    """
    ending = path.suffix.lower()
    if not path.exists():
        raise MissingFileError(f"no file {path}")
    if is_text(path):
        if names is None:
            names, no_header = column_names(path)
            times = names
        return read_columns(path, names, times=times, no_header=no_header)
    if ending == ".xlsx":
        return _excel(path, names, times, no_header)
    if path.is_dir() or ending in BAGS:
        from twin.measured.topics import topic_columns

        columns, dates = topic_columns(path, names), set[str]()
    else:
        with named_errors(f"{path} cannot be read"):
            arrays = {".npz": _npz, ".mat": _mat, ".parquet": _parquet}[ending](path, names)
            columns, dates = _numbers(arrays)
    count = max((len(values) for values in columns.values()), default=0)
    if count > MOST_ROWS:
        raise InputError(f"{path} has {count} rows: at most {MOST_ROWS} are read")
    nothing = np.zeros(count, bool)
    found = {
        name: Column(np.where(np.isfinite(values), values, np.nan), nothing, {}, "s" if name in dates else "")
        for name, values in columns.items()
    }
    if not found and names is None:
        raise InputError(f"{path} holds no columns of numbers")
    return CsvTable(path, tuple(found), np.arange(1, count + 1), found, _hash(path))


def is_text(path: Path) -> bool:
    """Return whether a log is read as text."""
    return path.suffix.lower() not in FORMATS and not (path / "metadata.yaml").is_file()


def _hash(path: Path) -> str:
    """Return the SHA-256 of a file, or of the first file of a bag."""
    files = [path] if path.is_file() else sorted([*path.glob("*.db3"), *path.glob("*.mcap")])
    return sha256_of(files[0])


def _numbers(arrays: dict[str, NDArray[Any]]) -> tuple[dict[str, Array], set[str]]:
    """Return the columns of the most frequent length, as numbers, and the names of dates, now in seconds."""
    columns: dict[str, Array] = {}
    dates = set()
    for name, array in arrays.items():
        values = np.squeeze(np.asarray(array))
        if values.dtype.kind == "M":
            dates.add(name)
            seconds = (values - np.datetime64(0, "s")) / np.timedelta64(1, "s")
            values = np.where(np.isnat(values), np.nan, seconds)
        if values.dtype.kind not in "biuf" or values.ndim not in (1, 2):
            continue
        if values.ndim == 1:
            columns[name] = values.astype(float)
        elif values.shape[1] <= _MOST_FIELDS:
            columns |= {f"{name}[{at}]": column.astype(float) for at, column in enumerate(values.T)}
    lengths = [len(values) for values in columns.values()]
    usual = max(lengths, key=lengths.count, default=0)
    return {name: values for name, values in columns.items() if len(values) == usual}, dates


def _npz(path: Path, names: Collection[str] | None) -> dict[str, NDArray[Any]]:
    with zipfile.ZipFile(path) as file:
        _check_size(sum(entry.file_size for entry in file.infolist()))
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files if _is_wanted(name, names)}


def _mat(path: Path, names: Collection[str] | None) -> dict[str, NDArray[Any]]:
    from scipy.io import loadmat, whosmat

    try:
        _check_size(sum(8 * int(np.prod(shape, dtype=float)) for _, shape, _ in whosmat(path)))
        contents = loadmat(path, squeeze_me=True)
    except NotImplementedError as error:
        raise InputError("it is of MATLAB's version 7.3: save it again by `save(..., '-v7')`") from error
    pairs = (pair for name, value in contents.items() for pair in _of_struct(name, value, 0))
    return {name: value for name, value in pairs if name[:2] != "__" and _is_wanted(name, names)}


def _of_struct(name: str, value: Any, depth: int) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the arrays in a variable of MATLAB; those in a struct are `struct.field`."""
    if isinstance(value, np.ndarray) and value.dtype.names and value.ndim == 0 and depth < 8:
        for field in value.dtype.names:
            yield from _of_struct(f"{name}.{field}", value[field].item(), depth + 1)
    elif isinstance(value, np.ndarray):
        yield name, value


def _parquet(path: Path, names: Collection[str] | None) -> dict[str, NDArray[Any]]:
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        groups = [file.metadata.row_group(at) for at in range(file.metadata.num_row_groups)]
        _check_size(sum(group.total_byte_size for group in groups))
        chosen = [name for name in file.schema_arrow.names if _is_wanted(name, names)]
        table = file.read(columns=chosen)
    return {name: table.column(name).to_numpy() for name in chosen}


def _is_wanted(name: str, names: Collection[str] | None) -> bool:
    return names is None or name in names or any(one.startswith(f"{name}[") for one in names)


def _check_size(size: int) -> None:
    if size > MOST_BYTES:
        raise InputError(f"it holds {size} bytes: at most {MOST_BYTES} are read")


def _excel(path: Path, names: Collection[str] | None, times: Collection[str], no_header: bool) -> CsvTable:
    """Read the first sheet of a workbook that holds something, as the text that it would be saved as."""
    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / f"{path.stem}.csv"
        with named_errors(f"{path} cannot be read"):
            _write_text(path, text)
        try:
            table = read_table(text, names, times=times, no_header=no_header)
        except InputError as error:
            raise InputError(str(error).replace(str(text), str(path))) from error
    return dataclasses.replace(table, path=path, sha256=sha256_of(path))


def _write_text(path: Path, text: Path) -> None:
    """Write the first sheet of a workbook that holds something as text."""
    import openpyxl

    with zipfile.ZipFile(path) as archive:
        _check_size(sum(entry.file_size for entry in archive.infolist()))
    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    for sheet in book.worksheets:
        with text.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            for row in sheet.iter_rows(values_only=True):
                writer.writerow(["" if cell is None else cell for cell in row])
        if text.stat().st_size:
            break
    book.close()
