"""Thermal calibration of ring laser gyros.

    >>> import sagnac
    >>> unit = sagnac.calibrate(["cycle-1.csv.gz", "cycle-2.csv.gz"], "bench.toml")
    >>> unit.verify("retest.csv.gz", limits="limits.toml").passed
    True

A run is a path, a data frame of pandas or polars, any object with Arrow's stream interface, or a dict of numpy arrays, with the column
names of a log: ``time_s``, ``counts`` or ``rate_dph``, ``temperature_c``.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence

from . import _progress, _sagnac
from ._errors import InputError, Refused, SagnacError
from ._results import (
    Axis,
    Calibration,
    ComparedAxis,
    Comparison,
    Compensator,
    Evaluation,
    Limit,
    NoiseAxis,
    NoiseBudget,
    NoiseTerm,
    Path,
    Table,
    Term,
    Verification,
    VerifiedAxis,
)
from ._sources import limits_of, runs_of, setup_of

__all__ = [
    "Axis",
    "Calibration",
    "ComparedAxis",
    "Comparison",
    "Compensator",
    "Evaluation",
    "InputError",
    "Limit",
    "NoiseAxis",
    "NoiseBudget",
    "NoiseTerm",
    "Refused",
    "SagnacError",
    "Table",
    "Term",
    "Verification",
    "VerifiedAxis",
    "allan",
    "calibrate",
    "compare",
    "simulate",
]

__version__ = _sagnac.VERSION


def calibrate(
    runs: object,
    setup: object = None,
    *,
    model: str = "auto",
    columns: Mapping[str, str] | None = None,
    warm_up: bool = False,
    remove_bias: bool = False,
    prior: Path | None = None,
    lot: str | None = None,
    keep_outliers: bool = False,
    progress: Callable[[str, int, int], object] | bool | None = None,
    **keys: object,
) -> Calibration:
    """Fits how bias and scale factor of a gyro move with temperature.

    Args:
        runs: A run, or a list of them: paths, data frames, Arrow streams, dicts of arrays.
        setup: A setup file, or a mapping with its keys.
        model: ``"auto"``, or such as ``"bias 3, rate 1"``.
        columns: Names of columns to Sagnac's own: ``{"gyro_z": "rate_radps_z"}``.
        warm_up: Corrects a drift with time that the runs show.
        remove_bias: Removes the fixed bias at the reference temperature too; needs ``input_rate_dph`` or ``earth``.
        prior: A file of ``sagnac fleet prior``.
        lot: The unit's lot, for the prior.
        keep_outliers: Keeps windows that look like bumps or steps.
        progress: Called with what is done, steps and number of steps; ``True`` for a bar, ``False`` for none, by default a bar where there
            is a terminal or a notebook.
        keys: Keys of a setup file: ``arcsec_per_count=1.059, axis="z", serial="RLG-7"``.

    Raises:
        InputError: A run or a setup that cannot be read.
        Refused: The data cannot support a calibration.
    """
    flags = [("warm_up", warm_up), ("remove_bias", remove_bias), ("keep_outliers", keep_outliers)]
    for name, value, of in [("model", model, str), *((name, value, bool) for name, value in flags)]:
        if not isinstance(value, of):
            raise InputError(f"{of.__name__} is needed, not {type(value).__name__}", name, f"give a {of.__name__}")
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    try:
        source_date_epoch = int(epoch) if epoch else None
        if source_date_epoch is not None and abs(source_date_epoch) >= 2**63:
            raise ValueError
    except ValueError:
        raise InputError("must be whole seconds", "SOURCE_DATE_EPOCH", "set it to seconds since 1970") from None
    asked: dict[str, object] = {
        "model": model,
        "warm_up": warm_up,
        "remove_bias": remove_bias,
        "source_date_epoch": source_date_epoch,
        "prior": None if prior is None else os.fspath(prior),
        "lot": lot,
        "keep_outliers": keep_outliers,
    }
    given = runs_of(runs)
    with _progress.watching(progress) as watcher, given.reading():
        native = _sagnac.calibrate(given, setup_of(setup, keys, columns), asked, watcher)
    return Calibration(native)


def allan(
    runs: object,
    setup: object = None,
    *,
    fs: float | None = None,
    quantity: str = "rate_dph",
    taus: str | Sequence[float] = "log",
    exact: bool = False,
    columns: Mapping[str, str] | None = None,
    **keys: object,
) -> NoiseBudget:
    """Splits the noise of a record at rest into its terms.

    Args:
        runs: As in :func:`calibrate`; or a one-dimensional array of values at ``fs``.
        setup: A setup file, or a mapping with its keys.
        fs: Values a second, Hz; with an array.
        quantity: What an array holds, as a header of a log: ``"rate_dph"``, ``"rate_radps"``, ``"counts"`` (then ``arcsec_per_count`` is
            needed).
        taus: ``"log"`` (ten a decade), ``"octave"``, ``"all"``, or averaging times in s.
        exact: Full overlap at every τ, with 8 bytes a row.
        columns: Names of columns to Sagnac's own.
        keys: Keys of a setup file.

    Raises:
        InputError: A record that cannot be read; an array without ``fs``.
        Refused: The record cannot support the figures.
    """
    if fs is not None:
        runs, keys = _of_values(runs, fs, quantity, keys)
    elif _is_values(runs):
        raise InputError("an array needs its sample rate", "fs", "give fs=, in Hz")
    word, times = _taus(taus)
    given = runs_of(runs)
    with given.reading():
        return NoiseBudget(_sagnac.allan(given, setup_of(setup, keys, columns), word, times, bool(exact)))


def _is_values(runs: object) -> bool:
    """One column: an array, a series, a list of numbers."""
    is_list = isinstance(runs, (list, tuple)) and all(isinstance(value, (int, float)) for value in runs) and bool(runs)
    return is_list or getattr(runs, "ndim", None) == 1 or type(runs).__name__.endswith(("Series", "Array"))


def _of_values(
    runs: object, fs: object, quantity: str, keys: dict[str, object]
) -> tuple[dict[str, object], dict[str, object]]:
    if not _is_values(runs):
        raise InputError("applies to an array only", "fs", "remove it: a table has its time, or sample_interval_s")
    if isinstance(fs, bool) or not isinstance(fs, (int, float)) or not 0.0 < fs < float("inf"):
        raise InputError("must be a number above 0", "fs", "give fs=, in Hz")
    if "sample_interval_s" in keys:
        raise InputError("fs and sample_interval_s both give the interval", "fs", "remove one of them")
    return {quantity: runs}, {"sample_interval_s": 1.0 / fs, **keys}


def _taus(taus: object) -> tuple[str, list[float]]:
    if isinstance(taus, str) and taus in ("log", "octave", "all"):
        return taus, []
    try:
        if isinstance(taus, (str, bytes)) or taus is None:
            raise TypeError
        return "given", [float(tau) for tau in taus]  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InputError("these are no times", "taus", "give 'log', 'octave', 'all' or a list of times in s") from None


def compare(calibrations: Sequence[Calibration] | Mapping[str, Calibration], limits: object = None) -> Comparison:
    """Compare records of one unit: cycles, turn-ons, months.

    Args:
        calibrations: In their order, or by their names.
        limits: As in :meth:`Calibration.verify`.
    """
    if isinstance(calibrations, Calibration):
        raise InputError("a comparison needs two or more records", "calibrations", "give a list or a mapping of them")
    if not isinstance(calibrations, Mapping):
        calibrations = {f"record {at}": record for at, record in enumerate(calibrations, 1)}
    wrong = next((record for record in calibrations.values() if not isinstance(record, Calibration)), None)
    if wrong is not None:
        raise InputError(f"no calibration: {type(wrong).__name__}", "calibrations", "read records with Calibration.read")
    named = [(str(name), record._native) for name, record in calibrations.items()]
    return Comparison(_sagnac.compare(named, limits_of(limits)))


def simulate(scenario: Path, seed: int | None = None) -> Table:
    """The log of a simulated test: the columns of ``sagnac simulate``.

    Args:
        scenario: Path of a scenario, or its TOML text.
        seed: Of all random numbers; that of the scenario by default.
    """
    text = os.fspath(scenario)
    if "\n" not in text:
        try:
            with open(text, encoding="utf-8") as file:
                text = file.read()
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"cannot read the scenario: {error}", text, "give the path of a scenario file") from error
    return Table(_sagnac.simulate(text, seed))
