"""Any table to what the native module reads: ``(kind, name, payload)``.

A run is a path, an object with Arrow's stream interface (polars, pyarrow, DuckDB …), a pandas data frame, or a mapping of names to
one-dimensional arrays. Arrow streams are read batch by batch and not copied; arrays are copied 65,536 rows at a time.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from ._errors import InputError
from ._packages import need

Run = tuple[str, str, object]

#: Rows of an array that are copied at a time.
ROWS = 1 << 16


def runs_of(runs: object) -> list[Run]:
    """One run, or a list or tuple of them."""
    if isinstance(runs, (list, tuple)):
        if not runs:
            raise InputError("no log given")
        return [_run(run, f"run {at}") for at, run in enumerate(runs, 1)]
    return [_run(runs, "table")]


def _run(run: object, name: str) -> Run:
    if isinstance(run, (str, os.PathLike)):
        return ("path", os.fspath(run), os.fspath(run))
    if _is_pandas(run):
        return _of_columns(name, {str(column): run[column] for column in _columns(run)})  # type: ignore[index]
    if hasattr(run, "__arrow_c_stream__"):
        return ("stream", name, run)
    if isinstance(run, Mapping):
        return _of_columns(name, {str(column): values for column, values in run.items()})
    raise InputError(
        f"no table: {type(run).__name__}",
        name,
        "give a path, a data frame, an object with __arrow_c_stream__, or a dict of arrays",
    )


def _is_pandas(run: object) -> bool:
    return type(run).__module__.split(".")[0] == "pandas" and hasattr(run, "columns")


def _columns(frame: Any) -> list[Any]:
    columns = list(frame.columns)
    if len({str(column) for column in columns}) < len(columns):
        raise InputError("two columns of one name", "data frame", "rename one of them")
    return columns


def _of_columns(name: str, columns: Mapping[str, Any]) -> Run:
    numpy = need("numpy", "columns")
    kinds: list[tuple[str, str]] = []
    arrays: list[tuple[str, Any, Any]] = []
    rows: int | None = None
    for column, values in columns.items():
        kind, array, mask = _array(numpy, name, column, values)
        if array.ndim != 1:
            raise InputError(f"{array.ndim} dimensions; a column has one", name, f"give {column!r} as a 1-D array")
        if rows is not None and len(array) != rows:
            raise InputError(f"{len(array)} rows of {column!r}, {rows} of the column before it", name)
        rows = len(array)
        kinds.append((column, kind))
        arrays.append((kind, array, mask))
    if not kinds:
        raise InputError("a table without columns", name)
    return ("columns", name, (kinds, _parts(numpy, name, arrays, rows or 0)))


def _array(numpy: Any, name: str, column: str, values: Any) -> tuple[str, Any, Any]:
    """Kind, array and mask of a column; nothing is copied but types that are not 64 bits wide."""
    dtype = getattr(values, "dtype", None)
    if _is_extension(dtype):
        # Types of pandas with a mask or a time zone.
        if getattr(dtype, "tz", None) is not None:
            values = values.dt.tz_convert("UTC").dt.tz_localize(None)
        elif getattr(dtype, "kind", "O") in "iufb":
            values = values.to_numpy(dtype="float64", na_value=numpy.nan)
        else:
            values = values.to_numpy(dtype=object, na_value=None)
    elif hasattr(values, "to_numpy"):
        values = values.to_numpy()
    mask = numpy.ma.getmaskarray(values) if isinstance(values, numpy.ma.MaskedArray) else None
    array = numpy.asarray(values)
    kind = array.dtype.kind
    if kind == "M":
        return "ns", array.astype("datetime64[ns]", copy=False), mask
    if kind == "m":
        return "f8", array / numpy.timedelta64(1, "s"), mask
    if kind == "b":
        return "?", array, mask
    if kind == "i" or (kind == "u" and array.dtype.itemsize < 8):
        # Whole numbers cannot be missing: those with a mask become floating-point ones.
        return ("f8" if mask is not None else "i8"), array, mask
    if kind in "fu":
        return "f8", array, mask
    if kind in "US":
        return "U", array.astype(str), mask
    if kind == "O":
        if all(value is None or isinstance(value, str) for value in array):
            return "U", array, mask
        raise InputError(
            f"column {column!r} holds Python objects, where numbers are needed",
            name,
            f"convert it, for example with astype(float); the first is {next(iter(array), None)!r:.40}",
        )
    raise InputError(f"column {column!r} of type {array.dtype}, where numbers are needed", name)


def _is_extension(dtype: object) -> bool:
    return dtype is not None and type(dtype).__module__.split(".")[0] == "pandas"


def _parts(numpy: Any, name: str, arrays: Sequence[tuple[str, Any, Any]], rows: int) -> Iterator[list[object]]:
    for start in range(0, rows, ROWS):
        end = min(start + ROWS, rows)
        yield [_part(numpy, name, kind, array, mask, start, end) for kind, array, mask in arrays]


def _part(numpy: Any, name: str, kind: str, array: Any, mask: Any, start: int, end: int) -> object:
    part = array[start:end]
    if len(part) != end - start:
        raise InputError("the table has become shorter while it was read", name)
    if kind == "U":
        hidden = mask[start:end] if mask is not None else [False] * len(part)
        return [None if value is None or gone else str(value) for value, gone in zip(part, hidden)]
    if kind == "f8":
        part = part.astype("<f8")
        if mask is not None:
            part[mask[start:end]] = numpy.nan
    elif kind == "i8":
        part = part.astype("<i8", copy=False)
    elif kind == "ns":
        part = part.view("i8").astype("<i8")
        if mask is not None:
            part[mask[start:end]] = numpy.iinfo("i8").min
    elif mask is not None:
        # A flag that is not known does not say that a row is good.
        part = part & ~mask[start:end]
    return part.tobytes()


def setup_of(setup: object, keys: Mapping[str, object], columns: Mapping[str, str] | None) -> tuple[str | None, str]:
    """The path of a setup and keys beside it, as JSON."""
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
        whole["columns"] = dict(columns)
    return path, to_json(whole, "setup")


def limits_of(limits: object) -> str | None:
    """The path or name of limits, or their keys as JSON."""
    if limits is None:
        return None
    if isinstance(limits, Mapping):
        return to_json(dict(limits), "limits")
    if isinstance(limits, (str, os.PathLike)):
        return os.fspath(limits)
    raise InputError(f"no limits: {type(limits).__name__}", "", "give a path, a name such as 'navigation-grade', or a mapping")


def to_json(keys: Mapping[str, object], what: str) -> str:
    """Keys as JSON; numbers of numpy are numbers."""

    def plain(value: object) -> object:
        if hasattr(value, "item"):
            return value.item()
        if isinstance(value, Iterable):
            return list(value)
        raise InputError(f"{what}: a value of type {type(value).__name__}")

    try:
        return json.dumps(keys, default=plain, allow_nan=False)
    except ValueError:
        raise InputError(f"{what}: a value that is not a finite number") from None
