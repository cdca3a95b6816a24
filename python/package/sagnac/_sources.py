"""Any table to what the native module reads: ``(kind, name, payload)``.

A run is a path, an object with Arrow's stream interface (polars, pyarrow, DuckDB …), a pandas data frame, or a mapping of names to
one-dimensional arrays. Arrow streams are read batch by batch and not copied; arrays are copied 65,536 rows at a time.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from ._errors import InputError
from ._packages import need

Run = tuple[str, str, object]

#: Rows of an array that are copied at a time.
ROWS = 1 << 16


class Runs(list[Run]):
    """Runs, and why columns of theirs cannot be read: an error only where a column is needed."""

    def __init__(self) -> None:
        super().__init__()
        self.unreadable: list[tuple[str, str, str]] = []

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Names why a column cannot be read, where reading fails for it."""
        try:
            yield
        except InputError as error:
            for name, column, why in self.unreadable:
                if name in error.place and f"`{column}`" in error.place and "contains Null" in error.reason:
                    help = 'convert it to numbers, or map it to "ignore" with columns='
                    raise InputError(f"column {column!r} {why}, and numbers are needed", name, help) from None
            raise


def runs_of(runs: object) -> Runs:
    """One run, or a list or tuple of them."""
    out = Runs()
    if not isinstance(runs, (list, tuple)):
        out.append(_run(runs, "table", out))
    elif not runs:
        raise InputError("no log is given", "", "give one or more logs")
    else:
        out.extend(_run(run, f"run {at}", out) for at, run in enumerate(runs, 1))
    return out


def _run(run: object, name: str, runs: Runs) -> Run:
    if isinstance(run, (str, os.PathLike)):
        path = os.fspath(run)
        if not isinstance(path, str):
            raise InputError("the path is bytes", repr(path), "give it as text")
        return ("path", path.encode("utf-8", "replace").decode(), path)
    if _is_frame(run):
        return _of_columns(name, {str(column): run[column] for column in _columns(run, name)}, runs)  # type: ignore[index]
    if hasattr(run, "__arrow_c_stream__"):
        return ("stream", name, run)
    if isinstance(run, Mapping):
        return _of_columns(name, {str(column): values for column, values in run.items()}, runs)
    raise InputError(
        f"no table: {type(run).__name__}",
        name,
        "give a path, a data frame, an object with __arrow_c_stream__, or a dict of arrays",
    )


def _is_frame(run: object) -> bool:
    """A data frame of pandas, or a class of a user's own made of it."""
    return any(of.__module__.split(".")[0] == "pandas" and of.__name__ == "DataFrame" for of in type(run).__mro__)


def _columns(frame: Any, name: str) -> list[Any]:
    columns = list(frame.columns)
    if len({str(column) for column in columns}) < len(columns):
        raise InputError("two columns of one name", name, "rename one of them")
    index = frame.index
    if index.name is not None or index.dtype.kind == "M":
        word = "its index" if index.name is None else f"its index {index.name!r}"
        raise InputError(f"{word} is not one of the columns, and would be lost", name, "give frame.reset_index()")
    return columns


@dataclass
class _Column:
    """Values of one kind, those that are missing, and why there are none."""

    kind: str
    values: Any
    mask: Any = None
    why: str = ""


def _of_columns(name: str, columns: Mapping[str, Any], runs: Runs) -> Run:
    numpy = need("numpy", "columns")
    made: list[tuple[str, _Column]] = []
    rows: int | None = None
    for column, values in columns.items():
        try:
            one = _column(numpy, values)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            one = _Column("none", values, why=f"cannot be read ({type(error).__name__}: {error})"[:200])
        if one.kind == "none":
            runs.unreadable.append((name, column, one.why))
        elif one.values.ndim != 1:
            raise InputError(f"{one.values.ndim} dimensions; a column has one", name, f"give {column!r} as a 1-D array")
        length = _length(one.values, name, column)
        if rows is not None and length != rows:
            raise InputError(f"{length} rows of {column!r}, {rows} of the column before it", name, "give columns of one length")
        rows = length
        made.append((column, one))
    if not made:
        raise InputError("a table without columns", name, "give columns such as time_s and counts")
    kinds = [(column, one.kind) for column, one in made]
    return ("columns", name, (kinds, _parts(numpy, name, [one for _, one in made], rows or 0)))


def _length(values: Any, name: str, column: str) -> int:
    try:
        return len(values)
    except TypeError:
        raise InputError(f"{column!r} is one value", name, "give an array") from None


def _column(numpy: Any, values: Any) -> _Column:
    """Kind, values and mask of a column; nothing is copied but types that are not 64 bits wide."""
    mask = None
    library = type(values).__module__.split(".")[0]
    if _is_extension(getattr(values, "dtype", None)):
        values, mask = _of_pandas(numpy, values)
    elif library == "pyarrow":
        values = values.combine_chunks() if hasattr(values, "combine_chunks") else values
        values = values.to_numpy(zero_copy_only=False)
    elif hasattr(values, "to_numpy"):
        values = values.to_numpy()
    elif isinstance(values, numpy.ma.MaskedArray):
        mask = numpy.ma.getmaskarray(values)
        values = values.data
    array = numpy.asarray(values)
    kind = array.dtype.kind
    if kind in "Mm":
        unit = "datetime64[ns]" if kind == "M" else "timedelta64[ns]"
        whole = array.astype(unit, copy=False)
        if (whole.astype(array.dtype) != array)[~numpy.isnat(array)].any():
            return _Column("none", array, why="holds times beyond the years 1678 to 2262")
        return _Column("ns" if kind == "M" else "dur", whole, mask)
    if kind == "u" and array.dtype.itemsize == 8:
        return _Column("u8", array, mask)
    if kind in "biuf":
        return _Column({"b": "?", "i": "i8", "u": "i8", "f": "f8"}[kind], array, mask)
    if kind in "UST":
        return _Column("U", array, mask)
    if kind == "O" and array.ndim == 1:
        return _of_objects(numpy, array, mask)
    return _Column("none", array, why=f"of type {array.dtype}") if array.ndim == 1 else _Column("f8", array)


def _of_objects(numpy: Any, array: Any, mask: Any) -> _Column:
    """Text, or whole or other numbers, of which some are missing."""
    gone = numpy.fromiter((_is_missing(value) for value in array), dtype=bool, count=len(array))
    if mask is not None:
        gone = gone | mask
    known = array[~gone]
    if all(isinstance(value, str) for value in known):
        return _Column("U", array, gone)
    if all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in known):
        # Whole numbers stay whole.
        numbers = numpy.zeros(len(array), dtype=numpy.array(known.tolist()).dtype)
        numbers[~gone] = known.tolist()
        if numbers.dtype.kind in "iuf":
            return _Column("i8" if numbers.dtype.kind == "i" else "f8", numbers, gone)
    first = next(value for value in known if not isinstance(value, str))
    return _Column("none", array, why=f"holds Python objects such as {first!r:.40}")


def _is_missing(value: object) -> bool:
    return value is None or (isinstance(value, float) and value != value) or type(value).__name__ in ("NAType", "NaTType")


def _is_extension(dtype: object) -> bool:
    return dtype is not None and type(dtype).__module__.split(".")[0] == "pandas"


def _of_pandas(numpy: Any, values: Any) -> tuple[Any, Any]:
    """A column of pandas' own types: those with a mask, with a time zone, of Arrow, of categories."""
    if hasattr(values.dtype, "categories"):
        values = values.astype(values.dtype.categories.dtype)
        if not _is_extension(values.dtype):
            return numpy.asarray(values), None
    dtype = values.dtype
    if getattr(dtype, "tz", None) or getattr(getattr(dtype, "pyarrow_dtype", None), "tz", None):
        if hasattr(values, "dt"):
            values = values.dt.tz_convert("UTC").dt.tz_localize(None)
        else:
            values = values.tz_convert("UTC").tz_localize(None)
    kind = getattr(dtype, "kind", "O")
    if kind in "Mm":
        unit = "datetime64[ns]" if kind == "M" else "timedelta64[ns]"
        return numpy.asarray(values.to_numpy(), dtype=unit), None
    mask = numpy.asarray(values.isna(), dtype=bool)
    if kind in "iub":
        of = {"i": "int64", "u": "uint64", "b": "bool"}[kind]
        return values.to_numpy(dtype=of, na_value=0), mask
    if kind == "f":
        return values.to_numpy(dtype="float64", na_value=numpy.nan), mask
    return values.to_numpy(dtype=object, na_value=None), mask


def _parts(numpy: Any, name: str, columns: Sequence[_Column], rows: int) -> Iterator[list[object]]:
    for start in range(0, rows, ROWS):
        end = min(start + ROWS, rows)
        yield [_part(numpy, name, column, start, end) for column in columns]


#: Types of the bytes of a part.
_BYTES = {"f8": "<f8", "i8": "<i8", "u8": "<u8", "?": "?"}


def _part(numpy: Any, name: str, column: _Column, start: int, end: int) -> object:
    if column.kind == "none":
        return end - start
    part = column.values[start:end]
    if len(part) != end - start:
        raise InputError("the table has become shorter while it was read", name, "give a copy of it")
    mask = None if column.mask is None else column.mask[start:end]
    if column.kind == "U":
        hidden = numpy.zeros(len(part), dtype=bool) if mask is None else mask
        return [None if gone or value is None else _text(value) for value, gone in zip(part, hidden)]
    if column.kind in ("ns", "dur"):
        part = part.view("i8").astype("<i8", copy=False)
    else:
        part = part.astype(_BYTES[column.kind], copy=False)
    return part.tobytes() if mask is None else (part.tobytes(), mask.astype(bool).tobytes())


def _text(value: object) -> str:
    """As UTF-8, whatever it holds: a column that is not read does not refuse a table."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return str(value).encode("utf-8", "replace").decode()


def setup_of(setup: object, keys: Mapping[str, object], columns: Mapping[str, str] | None) -> tuple[str | None, str]:
    """The path of a setup and keys next to it, as JSON."""
    path: str | None = None
    whole: dict[str, object] = {}
    if isinstance(setup, (str, os.PathLike)):
        path = os.fspath(setup)
    elif isinstance(setup, Mapping):
        whole.update({str(key): value for key, value in setup.items()})
    elif setup is not None:
        raise InputError(f"no setup: {type(setup).__name__}", "", "give a path or a mapping with the keys of a setup file")
    whole.update({key: value for key, value in keys.items() if value is not None})
    if columns is not None:
        if not isinstance(columns, Mapping):
            raise InputError("not a mapping", "columns", "give a mapping of names to Sagnac's headers")
        whole["columns"] = {str(name): own for name, own in columns.items()}
    return path, to_json(whole, "setup")


def limits_of(limits: object) -> str | None:
    """The path or name of limits, or their keys as JSON."""
    if limits is None:
        return None
    if isinstance(limits, Mapping):
        return to_json({str(name): value for name, value in limits.items() if value is not None}, "limits")
    if isinstance(limits, (str, os.PathLike)):
        return os.fspath(limits)
    raise InputError(f"no limits: {type(limits).__name__}", "", "give a path, a name such as 'navigation-grade', or a mapping")


def to_json(keys: Mapping[str, object], what: str) -> str:
    """Keys as JSON; numbers of numpy are numbers."""

    def plain(value: object) -> object:
        if hasattr(value, "tolist"):
            return value.tolist()
        if isinstance(value, Iterable):
            return list(value)
        raise InputError(f"{what}: a value of type {type(value).__name__}", "", "give numbers, text, lists and mappings")

    try:
        return json.dumps(keys, default=plain, allow_nan=False)
    except (TypeError, ValueError) as error:
        why = "a value that is not a finite number" if "JSON compliant" in str(error) else str(error)
        raise InputError(f"{what}: {why}", "", "give values that TOML can hold") from None
