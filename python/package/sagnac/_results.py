"""Results: objects with attributes, that print well and plot themselves."""

from __future__ import annotations

import html
import io
import json
import math
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from . import _plots, _sagnac
from ._errors import InputError
from ._packages import need
from ._sources import limits_of, runs_of, setup_of

if TYPE_CHECKING:
    import numpy
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[numpy.float64]

Path = str | os.PathLike[str]


class Table(Mapping[str, Any]):
    """Columns of equal length, for any library: ``polars.DataFrame(table)``, ``pyarrow.table(table)``, ``pandas.DataFrame(dict(table))``.

    ``table["hours"]`` is a numpy array (NaN where there is no value), or a list for text.
    """

    def __init__(self, native: _sagnac.Table) -> None:
        self._native = native

    @property
    def column_names(self) -> list[str]:
        """Names of the columns."""
        return self._native.column_names

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self._native)

    def __getitem__(self, name: str) -> Any:
        if not isinstance(name, str):
            raise KeyError(name)
        kind, values = self._native.column(name)
        if isinstance(values, list):
            return values
        numpy = need("numpy", "columns of a table")
        return numpy.frombuffer(values, dtype="<" + kind)

    def __iter__(self) -> Iterator[str]:
        return iter(self.column_names)

    def __len__(self) -> int:
        return len(self.column_names)

    def to_pydict(self) -> dict[str, list[Any]]:
        """As lists by name; no other package is needed."""
        return self._native.to_pydict()

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Arrow's PyCapsule interface."""
        return self._native.__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        return f"Table of {self.rows} rows: {', '.join(self.column_names)}"


#: °/h in one of each unit of rates, by the ending of an attribute.
DPH_PER_UNIT = {"dps": 3600.0, "mdps": 3.6, "radps": math.degrees(1.0) * 3600.0}


class Rates:
    """Rates of a result in other units: ``residual_dps`` is ``residual_dph`` in °/s, ``_mdps`` in m°/s, ``_radps`` in rad/s."""

    def __getattr__(self, name: str) -> Any:
        stem, _, unit = name.rpartition("_")
        if unit not in DPH_PER_UNIT or f"{stem}_dph" not in vars(self):
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}", name=name, obj=self)
        value = vars(self)[f"{stem}_dph"]
        return None if value is None else value / DPH_PER_UNIT[unit]


@dataclass(frozen=True, eq=False)
class Evaluation(Rates):
    """The correction at some temperatures.

    Attributes:
        temperature_c: Temperatures, °C.
        rate_cpm: Their rates, °C/min.
        drift_dph: Bias drift, °/h; zero at T0 and rest.
        lower_dph: Lower end of its 95 % interval, °/h; NaN where nothing was fitted.
        upper_dph: Upper end.
        scale_ppm: Deviation of the scale factor from that at T0, ppm.
        in_span: False outside the span of the fit, where the correction is that at its border.
    """

    temperature_c: Floats
    rate_cpm: Floats
    drift_dph: Floats
    lower_dph: Floats
    upper_dph: Floats
    scale_ppm: Floats
    in_span: NDArray[numpy.bool_]


@dataclass(frozen=True)
class Term:
    """A coefficient of the model: ``value`` ± ``sigma`` in ``unit``."""

    acts_on: str
    shape: Mapping[str, Any]
    times_rate: bool
    value: float
    sigma: float | None
    unit: str


@dataclass(frozen=True)
class Axis(Rates):
    """The calibration of an axis.

    Attributes:
        axis: Its letter.
        model: In the words of ``model=``.
        reference_c: T0, °C: the correction is zero there.
        span_c: Temperatures of the fit, °C.
        lag_s: Lag of the temperature in the rate terms, s; ``None`` without.
        residual_dph: σ of the residual of a nominal window, °/h; ``None`` for imported coefficients.
        noise_floor_dph: What noise alone leaves of it, °/h; ``None`` where it is not known.
        held_out_dph: σ of held-out residuals, °/h.
        terms: The coefficients.
    """

    axis: str
    model: str
    reference_c: float
    span_c: tuple[float, float]
    lag_s: float | None
    residual_dph: float
    noise_floor_dph: float | None
    held_out_dph: float | None
    terms: tuple[Term, ...] = field(repr=False)


def _axis(of: Mapping[str, Any]) -> Axis:
    def part(name: str, key: str) -> Any:
        found = of.get(name)
        return None if found is None else found.get(key)

    names = ("acts_on", "shape", "times_rate", "value", "sigma", "unit")
    low, high = of["span_c"]
    return Axis(
        axis=of["axis"],
        model=of["model"],
        reference_c=of["reference_c"],
        span_c=(low, high),
        lag_s=part("lag_s", "value"),
        residual_dph=part("residual", "sigma_dph") or float("nan"),
        noise_floor_dph=part("noise_floor", "value_dph"),
        held_out_dph=part("cross_validation", "sigma_dph"),
        terms=tuple(Term(**{name: term.get(name) for name in names}) for term in of["terms"]),
    )


AxisOf = TypeVar("AxisOf")


class _Result(Generic[AxisOf]):
    """What all results have in common: JSON, a report, axes by their letters."""

    _native: Any
    _json: str | None = None

    def to_json(self) -> str:
        """As JSON: the bytes that the program writes for the same input."""
        if self._json is None:
            self._json = self._native.to_json()
        return self._json

    def to_dict(self) -> dict[str, Any]:
        """The same as a dictionary."""
        found: dict[str, Any] = json.loads(self.to_json())
        return found

    def report(self, path: Path) -> None:
        """Writes the report: one HTML file that needs nothing else.

        Raises:
            InputError: A path that cannot be written; a record that was read, which has no data for a report.
        """
        text = self._native.report()
        try:
            with open(path, "w", encoding="utf-8", newline="") as file:
                file.write(text)
        except OSError as error:
            raise InputError(f"cannot write: {error.strerror}", os.fspath(path), "write to another folder") from error

    @property
    def axes(self) -> tuple[AxisOf, ...]:
        """The axes."""
        raise NotImplementedError

    def axis(self, letter: str | None = None) -> AxisOf:
        """An axis by its letter; the only one without.

        Raises:
            InputError: No such axis, or several and no letter.
        """
        letters = [getattr(axis, "axis") for axis in self.axes]
        if letter is None and len(letters) == 1:
            return self.axes[0]
        if letter in letters:
            return self.axes[letters.index(letter)]
        what = "no such axis" if letter is not None else "several axes; name one"
        raise InputError(what, f"axis {letter}" if letter is not None else "", f"choose one of these: {', '.join(letters)}")

    def _letter(self, axis: str | None) -> str:
        return str(getattr(self.axis(axis), "axis"))

    def _repr_html_(self) -> str:
        rows = (line.split(": ", 1) for line in repr(self).splitlines())
        cells = "".join(
            f"<tr><td>{html.escape(row[0])}</td><td>{html.escape(row[1]) if len(row) > 1 else ''}</td></tr>" for row in rows
        )
        return f"<table>{cells}</table>{self._figure()}"

    def _figure(self) -> str:
        """The figure as SVG, where matplotlib is there; a figure never breaks a notebook's cell."""
        try:
            figure = need("matplotlib.figure", "figures").Figure(figsize=(7.5, 3.4 * self._rows), layout="constrained")
            made = figure.subplots(self._rows, 1)
            self._draw(self._letter(None), made if self._rows > 1 else [made])
            out = io.StringIO()
            figure.savefig(out, format="svg")
            return out.getvalue()[out.getvalue().index("<svg") :]
        except InputError:
            return ""

    _rows = 1

    def _draw(self, axis: str, ax: Any) -> list[Any]:
        raise InputError("the report has no figure", "", "report a fit or a test with data")


def _numbers(numpy: Any, values: object) -> Any:
    """As floating-point numbers, NaN where they are masked."""
    array = numpy.ma.asarray(values) if isinstance(values, numpy.ma.MaskedArray) else numpy.asarray(values)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"of type {array.dtype}")
    return numpy.ma.filled(array.astype("<f8"), numpy.nan)


def _number(value: float | None, unit: str) -> str:
    return "not known" if value is None or value != value else f"{value:.4g} {unit}"


class Calibration(_Result[Axis]):
    """What a thermal test says of a gyro."""

    _rows = 2

    def __init__(self, native: _sagnac.Calibration) -> None:
        self._native = native
        self._axes: tuple[Axis, ...] | None = None

    @classmethod
    def read(cls, path: Path) -> Calibration:
        """Reads a record, as ``save`` or the program wrote it.

        Raises:
            InputError: Unreadable, no record, or of a version that this package does not know.
        """
        try:
            with open(path, encoding="utf-8") as file:
                text = file.read()
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"cannot read: {error}", os.fspath(path), "give the path of a calibration file") from error
        return cls(_sagnac.parse_calibration(text, os.fspath(path)))

    def save(self, path: Path) -> None:
        """Writes the record as JSON, whole or not at all."""
        self._native.save(os.fspath(path))

    @property
    def serial(self) -> str:
        """Serial number of the gyro; ``unassigned`` without one."""
        return str(self.to_dict()["serial"])

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The axes."""
        if self._axes is None:
            self._axes = tuple(_axis(axis) for axis in self.to_dict()["axes"])
        return self._axes

    @property
    def windows(self) -> Table:
        """The windows that the runs were summed into: run, times in s since its start, rates in °/h, temperatures in °C."""
        return Table(self._native.windows())

    def residuals(self, axis: str | None = None) -> Table:
        """Windows of an axis: ``hours``, ``temperature_c``, ``rate_cpm``, ``before_dph`` about the run's constant, ``after_dph`` less
        the fit (null where excluded), ``excluded`` with the reason."""
        return Table(self._native.residuals(self._letter(axis)))

    def notes(self, axis: str | None = None) -> list[tuple[str, str]]:
        """Notes to read before the fit is used: the level of each (`fact`, `note` or `warning`) and its words."""
        notes: list[tuple[str, str]] = self._native.notes(self._letter(axis))
        return notes

    def candidates(self, axis: str | None = None) -> Table:
        """The models that were tried for an axis, with their held-out residuals in °/h."""
        return Table(self._native.candidates(self._letter(axis)))

    def evaluate(self, temperature_c: ArrayLike, rate_cpm: ArrayLike = 0.0, axis: str | None = None) -> Evaluation:
        """The correction at temperatures (°C) and their rates (°C/min); shapes are broadcast.

        Returns:
            Arrays of the broadcast shape.

        Raises:
            InputError: Shapes that do not go together, values that are not numbers, several axes and none named.
        """
        numpy = need("numpy", "evaluations")
        try:
            celsius, cpm = numpy.broadcast_arrays(_numbers(numpy, temperature_c), _numbers(numpy, rate_cpm))
        except (TypeError, ValueError) as error:
            raise InputError(f"temperatures and rates must be numbers: {error}", "", "give numbers or arrays of numbers") from error
        numbers, in_span = self._native.evaluate(self._letter(axis), celsius.tobytes(), cpm.tobytes())
        drift, lower, upper, scale = (numpy.frombuffer(part, dtype="<f8").reshape(celsius.shape) for part in numbers)
        within = numpy.frombuffer(in_span, dtype="?").reshape(celsius.shape)
        return Evaluation(celsius, cpm, drift, lower, upper, scale, within)

    def verify(
        self,
        runs: object,
        limits: object = None,
        *,
        setup: object = None,
        columns: Mapping[str, str] | None = None,
        exclude: Sequence[str] = (),
        **keys: object,
    ) -> Verification:
        """Replays retests through the image of this calibration, as the gyro's processor would.

        Args:
            runs: Logs that the fit did not see, as in :func:`sagnac.calibrate`.
            limits: A TOML file, ``"navigation-grade"``, ``"paper"``, or a mapping with keys of a limits file.
            setup: Keys that differ from those of the calibration.
            columns: Names of columns to Sagnac's own.
            exclude: ``"outliers"``, ``"start"``: what is not judged, for a bench that was bumped.
            keys: Keys of a setup file.

        Raises:
            InputError: Logs that cannot be read or do not fit the calibration.
            Refused: None of the limits can be asked of such a retest, or there is too little of it.
        """
        unknown = set(exclude) - {"outliers", "start"}
        if unknown or isinstance(exclude, str):
            raise InputError("unknown exclusion", "exclude", "give 'outliers', 'start' or both")
        given = ("outliers" in exclude, "start" in exclude)
        retests = runs_of(runs)
        with retests.reading():
            native = self._native.verify(retests, setup_of(setup, keys, columns), limits_of(limits), given)
        return Verification(native)

    def compensate(
        self,
        run: object,
        *,
        setup: object = None,
        columns: Mapping[str, str] | None = None,
        **keys: object,
    ) -> Table:
        """A log as the gyro's processor would give it, count by count.

        Returns:
            ``row`` of a table (from 0) or ``line`` of a file (from 1), ``time_s``, and of each axis ``counts_x`` (or ``angle_arcsec_x`` of a
            log of rates) and ``status_x`` (null where there is nothing to say). Rows that cannot be used are not there.

        Warns:
            UserWarning: Less than nine tenths of the rows were corrected within the span of the fit.
        """
        given = runs_of([run])
        with given.reading():
            table, good, rows = self._native.compensate(given[0], setup_of(setup, keys, columns))
        if good < 0.9 * rows:
            what = f"{good} of {rows} rows are corrected within the span of the fit: wrong units, another thermometer or another test"
            warnings.warn(what, stacklevel=2)
        return Table(table)

    def image(self, axis: str | None = None, sequence: int = 1) -> bytes:
        """The flash image of an axis; the image with the larger ``sequence`` is the newer one."""
        if isinstance(sequence, bool) or not isinstance(sequence, int) or not 0 <= sequence < 2**32:
            raise InputError("out of range", "sequence", "give a whole number from 0 to 2**32 − 1")
        image: bytes = self._native.image(self._letter(axis), sequence)
        return image

    def __reduce__(self) -> tuple[object, ...]:
        """Pickled and copied as its record; windows and report stay behind."""
        return _unpickled, (self.to_json(),)

    def compensator(self, axis: str | None = None) -> Compensator:
        """The gyro's own processor for an axis."""
        return Compensator(self.image(axis))

    def export_c(self, folder: Path, sequence: int = 1) -> list[str]:
        """Writes C99 sources with this calibration's images; their paths."""
        return [os.fspath(path) for path in self._native.export_c(os.fspath(folder), sequence)]

    def plot(self, axis: str | None = None, ax: Any = None) -> list[Any]:
        """Drift over temperature with the fit and its interval, and the residual over time, in matplotlib.

        Args:
            axis: Letter of the axis; needed where there are several.
            ax: Two axes to draw on; new ones without.

        Returns:
            The axes.
        """
        return _plots.calibration(self, self._letter(axis), ax)

    def _draw(self, axis: str, ax: Any) -> list[Any]:
        return _plots.calibration(self, axis, ax)

    def __repr__(self) -> str:
        lines = [f"Calibration of {self.serial}"]
        for axis in self.axes:
            low, high = axis.span_c
            lines.append(
                f"axis {axis.axis}: `{axis.model}`, {low:.4g} … {high:.4g} °C, residual σ {_number(axis.residual_dph, '°/h')}, "
                f"noise floor {_number(axis.noise_floor_dph, '°/h')}"
            )
        return "\n".join(lines)


def _unpickled(text: str) -> Calibration:
    return Calibration(_sagnac.parse_calibration(text, "a pickled calibration"))


@dataclass(frozen=True)
class Limit:
    """A limit and its value; ``met`` is ``None`` where it could not be asked."""

    name: str
    bound: float
    value: float | None
    sigma: float | None
    met: bool | None


@dataclass(frozen=True)
class VerifiedAxis(Rates):
    """The retest of an axis.

    Attributes:
        axis: Its letter.
        before_dph: σ of a window before the correction, °/h.
        after_dph: After it.
        noise_floor_dph: What noise alone leaves, °/h; ``None`` where it is not known.
        passed: Whether every limit is met; ``None`` without limits.
        limits: Each limit.
    """

    axis: str
    before_dph: float
    after_dph: float
    noise_floor_dph: float | None
    passed: bool | None
    limits: tuple[Limit, ...] = field(repr=False)


class Verification(_Result[VerifiedAxis]):
    """What a retest came to."""

    def __init__(self, native: _sagnac.Verification) -> None:
        self._native = native

    @property
    def passed(self) -> bool:
        """False where a limit is not met, and where limits were checked with a log of the fit."""
        return bool(self._native.passed)

    @property
    def axes(self) -> tuple[VerifiedAxis, ...]:
        """The axes."""

        def one(of: Mapping[str, Any]) -> VerifiedAxis:
            limits = tuple(
                Limit(limit["name"], limit["limit"], limit["value"], limit.get("sigma"), limit["pass"])
                for limit in of["limits"]
            )
            floor = (of.get("noise_floor") or {}).get("value_dph")
            return VerifiedAxis(
                of["axis"], of["before"]["sigma_dph"], of["after"]["sigma_dph"], floor, of["pass"], limits
            )

        return tuple(one(axis) for axis in self.to_dict()["axes"])

    def residuals(self, axis: str | None = None) -> Table:
        """Windows of an axis: ``hours``, ``temperature_c``, ``before_dph`` and ``after_dph``."""
        return Table(self._native.residuals(self._letter(axis)))

    def plot(self, axis: str | None = None, ax: Any = None) -> list[Any]:
        """Rate before and after the correction over temperature, in matplotlib."""
        return _plots.verification(self, self._letter(axis), ax)

    def _draw(self, axis: str, ax: Any) -> list[Any]:
        return _plots.verification(self, axis, ax)

    def __repr__(self) -> str:
        word = {True: "limits met", False: "LIMITS NOT MET", None: "no limits"}
        lines = ["Verification: " + ("passed" if self.passed else "NOT PASSED")]
        for axis in self.axes:
            lines.append(
                f"axis {axis.axis}: {word[axis.passed]}; σ {_number(axis.before_dph, '°/h')} before, "
                f"{_number(axis.after_dph, '°/h')} after, noise floor {_number(axis.noise_floor_dph, '°/h')}"
            )
            lines += [
                f"{limit.name}: {_number(limit.value, '')}against {limit.bound:.4g}, NOT MET"
                for limit in axis.limits
                if limit.met is False
            ]
        return "\n".join(lines)


@dataclass(frozen=True)
class NoiseTerm:
    """A noise term with its 95 % interval, or why it is not resolved (then ``value`` is ``None``)."""

    value: float | None
    lower: float | None
    upper: float | None
    unit: str
    unresolved: str | None


_TERMS = {
    "Q": ("q_arcsec", "arcsec"),
    "N": ("n_deg_rt_h", "°/√h"),
    "B": ("b_dph", "°/h"),
    "K": ("k_dph_rt_h", "°/h/√h"),
    "R": ("r_dph_h", "°/h/h"),
}


@dataclass(frozen=True, eq=False)
class NoiseAxis(Rates):
    """The noise of an axis.

    Attributes:
        axis: Its letter.
        tau_s: Averaging times, s.
        adev_dph: Overlapping Allan deviation, °/h.
        lower_dph: Lower end of its interval, °/h.
        upper_dph: Upper end.
        terms: ``Q``, ``N``, ``B``, ``K``, ``R`` after IEEE Std 952.
    """

    axis: str
    tau_s: Floats = field(repr=False)
    adev_dph: Floats = field(repr=False)
    lower_dph: Floats = field(repr=False)
    upper_dph: Floats = field(repr=False)
    terms: Mapping[str, NoiseTerm]


class NoiseBudget(_Result[NoiseAxis]):
    """The noise of a record at rest, term by term."""

    def __init__(self, native: _sagnac.NoiseBudget) -> None:
        self._native = native

    @property
    def axes(self) -> tuple[NoiseAxis, ...]:
        """The axes."""
        numpy = need("numpy", "curves")

        def term(of: Mapping[str, Any], unit: str) -> NoiseTerm:
            return NoiseTerm(of.get("value"), of.get("lower"), of.get("upper"), unit, of.get("unresolved"))

        def one(of: Mapping[str, Any]) -> NoiseAxis:
            tau, adev, lower, upper = (
                numpy.array([numpy.nan if point.get(key) is None else point[key] for point in of["curve"]])
                for key in ("tau_s", "adev_dph", "lower_dph", "upper_dph")
            )
            terms = {letter: term(of["terms"][key], unit) for letter, (key, unit) in _TERMS.items()}
            return NoiseAxis(of["axis"], tau, adev, lower, upper, terms)

        return tuple(one(axis) for axis in self.to_dict()["axes"])

    @property
    def tau_s(self) -> Floats:
        """Averaging times of the only axis, s."""
        return self.axis().tau_s

    @property
    def adev(self) -> Floats:
        """Overlapping Allan deviation of the only axis, °/h."""
        return self.axis().adev_dph

    @property
    def terms(self) -> Mapping[str, NoiseTerm]:
        """Noise terms of the only axis."""
        return self.axis().terms

    @property
    def warnings(self) -> list[str]:
        """What to know of the figures."""
        return list(self.to_dict()["warnings"])

    def plot(self, axis: str | None = None, ax: Any = None) -> list[Any]:
        """Allan deviation over τ, in matplotlib."""
        return _plots.noise(self, self._letter(axis), ax)

    def _draw(self, axis: str, ax: Any) -> list[Any]:
        return _plots.noise(self, axis, ax)

    def __repr__(self) -> str:
        lines = ["Noise budget"]
        for axis in self.to_dict()["axes"]:
            found = {letter: axis["terms"][key].get("value") for letter, (key, _) in _TERMS.items()}
            known = ", ".join(f"{name} {value:.3g} {_TERMS[name][1]}" for name, value in found.items() if value is not None)
            lines.append(f"axis {axis['axis']}: {known or 'no term is resolved'}")
        return "\n".join(lines + [f"warning: {warning}" for warning in self.warnings])


@dataclass(frozen=True)
class ComparedAxis:
    """An axis of a comparison; ``passed`` is ``None`` without limits."""

    axis: str
    passed: bool | None


class Comparison(_Result[ComparedAxis]):
    """Records of one unit, compared."""

    def __init__(self, native: _sagnac.Comparison) -> None:
        self._native = native

    @property
    def passed(self) -> bool:
        """False where a limit is not met."""
        return bool(self._native.passed)

    @property
    def axes(self) -> tuple[ComparedAxis, ...]:
        """The axes."""
        return tuple(ComparedAxis(axis["axis"], axis.get("pass")) for axis in self.to_dict()["axes"])

    @property
    def words(self) -> list[str]:
        """What changed, a line a curve."""
        words: list[str] = self._native.words()
        return words

    def __repr__(self) -> str:
        return "\n".join(["Comparison: " + ("passed" if self.passed else "NOT PASSED"), *self.words])


class Compensator:
    """The gyro's own processor: from counts and codes of thermometers to corrected counts, in integers, as on the target.

    An update of the codes is due before the first tick and after every ``period_ticks``.
    """

    def __init__(self, image: bytes) -> None:
        self._native = _sagnac.Compensator(bytes(image))

    @property
    def period_ticks(self) -> int:
        """Ticks between two updates."""
        return self._native.period_ticks

    @property
    def inputs(self) -> int:
        """Codes that an update takes."""
        return self._native.inputs

    @property
    def status(self) -> str:
        """Status of the last update or tick, in words; ``ok`` where there is nothing to say."""
        return self._native.status

    def update(self, codes: Sequence[int | None]) -> str:
        """A slow update with one code per input, ``None`` where there is no sample; the status.

        Raises:
            InputError: Not due, or the wrong number of codes; nothing has changed then.
        """
        return self._native.update([None if code is None else _within_32_bits("a code", code) for code in codes])

    def tick(self, counts: int) -> int:
        """One tick: counts in, corrected counts out.

        Raises:
            InputError: An update is due, or counts beyond 2²⁹; nothing has changed then.
        """
        return self._native.tick(_within_32_bits("counts", counts))

    def run(self, counts: ArrayLike, codes: ArrayLike) -> tuple[NDArray[numpy.int32], NDArray[numpy.uint32]]:
        """Many ticks.

        Args:
            counts: Counts of each tick, shape ``(ticks,)``.
            codes: Codes of each update that falls due, shape ``(updates, inputs)``; ``-2**31`` where there is no sample.

        Returns:
            Corrected counts of each tick, and status bits of each update that was made.

        Raises:
            InputError: Arrays of other shapes or values; fewer codes than updates that fall due. Nothing has changed then.
        """
        numpy = need("numpy", "many ticks")
        ticks, rows = _whole(numpy, "counts", counts, 1), _whole(numpy, "codes", codes, 2, missing=NO_SAMPLE)
        if rows.shape[1] != self.inputs:
            raise InputError(f"codes of {rows.shape[1]} inputs, the image has {self.inputs}", "codes", f"give {self.inputs} codes per row")
        before = self._native.copy()
        try:
            return self._run_in_pieces(numpy, ticks, rows)
        except BaseException:
            self._native = before
            raise

    def _run_in_pieces(self, numpy: Any, ticks: Any, rows: Any) -> tuple[Any, Any]:
        corrected = numpy.empty(len(ticks), dtype="<i4")
        statuses: list[int] = []
        for start in range(0, len(ticks), _TICKS_OF_A_PIECE):
            piece = ticks[start : start + _TICKS_OF_A_PIECE]
            # As many as can fall due, for the rest is copied with its own piece.
            due = rows[len(statuses) :][: len(piece) // self.period_ticks + 2]
            counted, updates = self._native.run(piece.tobytes(), due.tobytes())
            corrected[start : start + len(piece)] = numpy.frombuffer(counted, dtype="<i4")
            statuses += updates
        return corrected, numpy.array(statuses, dtype="u4")


#: Ticks that are copied at a time: their bytes stay in the processor's cache.
_TICKS_OF_A_PIECE = 65_536

#: In codes: no sample.
NO_SAMPLE = -(2**31)


def _within_32_bits(what: str, value: object) -> int:
    if isinstance(value, bool) or not hasattr(value, "__index__") or not -(2**31) <= value.__index__() < 2**31:
        raise InputError(f"{what}: {value!r:.40} is not a whole number of 32 bits", "", "give a whole number")
    return int(value.__index__())


def _whole(numpy: Any, name: str, values: object, dimensions: int, missing: int | None = None) -> Any:
    if isinstance(values, numpy.ma.MaskedArray) and numpy.ma.is_masked(values):
        if missing is None:
            raise InputError(f"{name} has masked values", "", "fill them first")
        values = numpy.ma.filled(values.astype("i8"), missing)
    array = numpy.asarray(values)
    if array.size == 0 and array.ndim == dimensions:
        array = array.astype("<i4")
    if array.ndim != dimensions:
        raise InputError(f"{name} has {array.ndim} dimensions, not {dimensions}", "", "reshape the array")
    if array.dtype.kind not in "iu":
        raise InputError(f"{name} has the type {array.dtype}, and whole numbers are needed", "", "convert it: array.astype('i4')")
    if array.size and array.dtype != numpy.int32 and (array.min() < -(2**31) or array.max() > 2**31 - 1):
        raise InputError(f"{name} exceeds 32 bits", "", "give values of 32 bits")
    return array.astype("<i4", copy=False)
