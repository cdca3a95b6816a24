"""Any table: the same rows give the same record, whatever holds them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy
import pandas
import polars
import pyarrow
import pytest
from conftest import CHAMBER, MODEL
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import sagnac

BENCH = CHAMBER / "bench.toml"


def calibrated(runs: object, **keys: Any) -> sagnac.Calibration:
    return sagnac.calibrate(runs, BENCH, model=MODEL, **keys)


def test_every_library_gives_the_same_record(frames: list[polars.DataFrame]) -> None:
    runs = frames[:2]
    wanted = calibrated(runs).to_json()

    def batches(frame: polars.DataFrame) -> pyarrow.RecordBatchReader:
        table = frame.to_arrow()
        return pyarrow.RecordBatchReader.from_batches(table.schema, iter(table.to_batches(max_chunksize=777)))

    with_gaps = [frame.with_columns(polars.col("counts").cast(polars.Float32)) for frame in runs]
    forms: dict[str, list[Any]] = {
        "pandas": [frame.to_pandas() for frame in runs],
        "pandas, nullable": [frame.to_pandas().convert_dtypes() for frame in runs],
        "pandas, pyarrow": [frame.to_pandas(use_pyarrow_extension_array=True) for frame in runs],
        "pyarrow": [frame.to_arrow() for frame in runs],
        "batches": [batches(frame) for frame in runs],
        "numpy": [{name: frame[name].to_numpy() for name in frame.columns} for frame in runs],
        "strided": [{name: numpy.repeat(frame[name].to_numpy(), 3)[::3] for name in frame.columns} for frame in runs],
        "big-endian": [{name: frame[name].to_numpy().astype(">f8") for name in frame.columns} for frame in runs],
        "masked": [
            {name: numpy.ma.masked_array(frame[name].to_numpy().astype(float)) for name in frame.columns} for frame in runs
        ],
        "lists": [frame.to_dict(as_series=False) for frame in runs],
        "narrow": with_gaps,
    }
    for form, tables in forms.items():
        assert calibrated(tables).to_json() == wanted, form


def test_a_file_and_its_table_differ_in_names_alone(frames: list[polars.DataFrame]) -> None:
    of_table = calibrated(frames[:2]).to_dict()
    of_file = calibrated([CHAMBER / "cycle-1.csv.gz", CHAMBER / "cycle-2.csv.gz"]).to_dict()
    assert of_table["axes"] == of_file["axes"]
    sketches = [[log["rows_sketch"] for log in record["provenance"]["inputs"]] for record in (of_table, of_file)]
    assert sketches[0] == sketches[1]


def test_missing_values_are_missing(frames: list[polars.DataFrame]) -> None:
    frame = frames[0].with_columns(
        polars.when(polars.int_range(polars.len()) % 97 == 5).then(None).otherwise(polars.col("counts")).alias("counts")
    )
    mask = frame["counts"].is_null().to_numpy()
    assert mask.sum() > 50
    wanted = calibrated(frame).to_json()
    as_nan = frame.to_pandas()
    assert as_nan["counts"].dtype == float
    nullable = frame.to_pandas().assign(counts=lambda table: table["counts"].astype("Int64"))
    hidden = {name: frame[name].to_numpy() for name in ("time_s", "temperature_c")}
    full = frames[0]["counts"].to_numpy()
    masked = hidden | {"counts": numpy.ma.masked_array(full, mask=mask)}
    for table in (as_nan, nullable, frame.to_arrow(), masked):
        assert calibrated(table).to_json() == wanted
    assert '"not_a_number"' in wanted or '"no_counts"' in wanted or "excluded" in wanted


def test_dates_and_names(frames: list[polars.DataFrame]) -> None:
    frame = frames[0].to_pandas()
    wanted = calibrated(frame).to_dict()["axes"]
    start = pandas.Timestamp("2026-03-01")
    dated = frame.rename(columns={"time_s": "when"})
    dated["when"] = start + pandas.to_timedelta(dated["when"], unit="s")
    # A zone is a clock on the wall; the time is the same.
    zoned = dated.assign(when=dated["when"].dt.tz_localize("UTC").dt.tz_convert("America/Lima"))
    for table in (dated, zoned):
        assert calibrated(table, columns={"when": "time_iso"}).to_dict()["axes"] == wanted
    since = frame.assign(time_s=pandas.to_timedelta(frame["time_s"], unit="s"))
    assert calibrated(since).to_dict()["axes"] == wanted
    renamed = frame.rename(columns={"counts": "gyro", "temperature_c": "t block"})
    names = {"gyro": "counts_z", "t block": "temperature_c"}
    assert calibrated(renamed, columns=names).to_dict()["axes"] == wanted


BAD: dict[str, tuple[Any, str]] = {
    "nothing": ([], "no log"),
    "a number": (7, "no table"),
    "no columns": ({}, "without columns"),
    "no rows": ({"time_s": numpy.zeros(0), "counts": numpy.zeros(0), "temperature_c": numpy.zeros(0)}, ""),
    "objects": ({"time_s": [object()], "counts": [1]}, "Python objects"),
    "complex": ({"time_s": numpy.zeros(3, complex), "counts": numpy.zeros(3)}, "type complex128"),
    "two dimensions": ({"time_s": numpy.zeros((3, 2)), "counts": numpy.zeros(3)}, "2 dimensions"),
    "other lengths": ({"time_s": numpy.arange(3.0), "counts": numpy.arange(4)}, "4 rows"),
    "text": ({"time_s": ["a", "b"], "counts": ["1", "2"]}, ""),
    "all NaT": ({"time_iso": numpy.full(9, "NaT", "datetime64[ns]"), "counts": numpy.arange(9)}, ""),
    "all masked": ({"time_s": numpy.ma.masked_array(numpy.zeros(9), mask=True), "counts": numpy.arange(9)}, ""),
    "unknown names": ({"a": numpy.arange(9.0), "b": numpy.arange(9.0)}, ""),
    "beyond": ({"time_s": numpy.arange(9.0) * 1e300, "counts": numpy.full(9, 2**62)}, ""),
    "same name twice": (pandas.DataFrame([[1, 2, 3]], columns=["time_s", "counts", "counts"]), "two columns"),
    "a missing file": ("no-such-file.csv", "cannot open"),
    "a folder": (os.fspath(CHAMBER), "folder"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_tables_are_named(name: str) -> None:
    table, words = BAD[name]
    with pytest.raises(sagnac.SagnacError) as raised:
        calibrated(table)
    error = raised.value
    assert words in error.reason and error.reason and str(error), str(error)
    assert isinstance(error, (sagnac.InputError, sagnac.Refused))


def test_bad_arguments_are_named(frames: list[polars.DataFrame]) -> None:
    table = frames[0]
    calls: list[tuple[Callable[[], object], str]] = [
        (lambda: sagnac.calibrate(table, 7), "no setup"),
        (lambda: sagnac.calibrate(table, BENCH, model="bias 99"), "bias 99"),
        (lambda: sagnac.calibrate(table, {"no_such_key": 1}), "no_such_key"),
        (lambda: sagnac.calibrate(table, arcsec_per_count=float("nan")), "finite"),
        (lambda: sagnac.calibrate(table, arcsec_per_count=-1.0), "arcsec_per_count"),
        (lambda: sagnac.calibrate(table), "arcsec"),
        (lambda: sagnac.calibrate(table, BENCH, prior="none.json"), "none.json"),
        (lambda: sagnac.allan(numpy.zeros(9)), "sample rate"),
        (lambda: sagnac.allan(numpy.zeros(9), fs=-1.0), "above 0"),
        (lambda: sagnac.allan(table, BENCH, fs=1.0), "array"),
        (lambda: sagnac.allan(table, BENCH, taus="some"), "octave"),
        (lambda: sagnac.simulate("no-such-scenario.toml"), "scenario"),
        (lambda: sagnac.simulate("[gyro]\nspeed = 3\n"), "unknown field `gyro`"),
        (lambda: sagnac.Calibration.read(BENCH), "bench.toml"),
        (lambda: calibrated(table).evaluate("warm"), "numbers"),
        (lambda: calibrated(table).axis("q"), "no such axis"),
        (lambda: calibrated(table).image("q"), "no such axis"),
        (lambda: calibrated(table).verify(frames[2], limits=7), "no limits"),
        (lambda: calibrated(table).verify(frames[2], limits={"wrong": 1.0}), "wrong"),
        (lambda: calibrated(table).verify(frames[2], exclude="start"), "exclude"),
        (lambda: sagnac.Compensator(b"no image"), "usable image"),
    ]
    for call, words in calls:
        with pytest.raises(sagnac.SagnacError) as raised:
            call()
        assert words in str(raised.value), str(raised.value)


def test_a_refusal_says_what_to_do(frames: list[polars.DataFrame]) -> None:
    with pytest.raises(sagnac.Refused) as raised:
        calibrated(frames[0].head(500))
    assert "span" in raised.value.reason and raised.value.help and "test over a wider range" in raised.value.help


def test_a_generator_that_raises_is_heard(frames: list[polars.DataFrame]) -> None:
    table = frames[0].to_arrow()

    def broken() -> Iterator[pyarrow.RecordBatch]:
        yield from table.to_batches(max_chunksize=1000)[:3]
        raise RuntimeError("the logger went away")

    reader = pyarrow.RecordBatchReader.from_batches(table.schema, broken())
    with pytest.raises(sagnac.SagnacError, match="the logger went away"):
        calibrated(reader)
    # A stream is read once.
    once = pyarrow.RecordBatchReader.from_batches(table.schema, iter(table.to_batches()))
    calibrated(once)
    with pytest.raises((sagnac.SagnacError, ValueError, pyarrow.ArrowException)):
        calibrated(once)


def test_a_table_that_changes_meanwhile_is_no_abort(frames: list[polars.DataFrame]) -> None:
    frame = frames[0]
    columns = {name: numpy.tile(frame[name].to_numpy().astype(float), 40) for name in frame.columns}
    columns["time_s"] = numpy.arange(len(columns["counts"])) * 5.0 + 5.0
    stop = threading.Event()

    def scribble() -> None:
        random = numpy.random.default_rng(1)
        while not stop.is_set():
            columns["counts"][random.integers(0, len(columns["counts"]), 1000)] = random.normal(size=1000) * 1e9

    other = threading.Thread(target=scribble)
    other.start()
    try:
        calibrated(columns)
    except sagnac.SagnacError as error:
        assert error.reason
    finally:
        stop.set()
        other.join()


def with_bystanders(frame: polars.DataFrame) -> polars.DataFrame:
    """With four columns without any effect: the search tries each, which takes seconds."""
    random = numpy.random.default_rng(1)
    walks = random.normal(size=(4, len(frame))).cumsum(axis=1)
    return frame.with_columns([polars.Series(f"aux_{at}", walk) for at, walk in enumerate(walks)])


def test_others_work_meanwhile(frames: list[polars.DataFrame]) -> None:
    """Python's lock is free: another thread counts while a model is searched for."""
    counted, stop = 0, threading.Event()

    def count() -> None:
        nonlocal counted
        while not stop.is_set():
            counted += 1

    other = threading.Thread(target=count)
    said: list[int] = []

    def progress(what: str, done: int, of: int) -> None:
        said.append(counted)

    other.start()
    sagnac.calibrate([with_bystanders(frame) for frame in frames], BENCH, progress=progress)
    stop.set()
    other.join()
    # Between two steps of the fit the other thread went on, again and again.
    assert len(said) > 50 and len(set(said)) > 2


def test_progress_may_end_the_fit(frames: list[polars.DataFrame]) -> None:
    seen: list[str] = []

    def enough(what: str, done: int, of: int) -> None:
        seen.append(what)
        if len(seen) == 20:
            raise StopAsyncIteration("enough")

    with pytest.raises(StopAsyncIteration, match="enough"):
        sagnac.calibrate([with_bystanders(frame) for frame in frames], BENCH, progress=enough)
    assert "axis z" in seen[0]


def in_a_process(code: str) -> "subprocess.Popen[str]":
    pipe = subprocess.PIPE
    words = [sys.executable, "-c", textwrap.dedent(code)]
    return subprocess.Popen(words, cwd=CHAMBER, stdout=pipe, stderr=pipe, text=True)


def test_ctrl_c_ends_the_work() -> None:
    """A signal while fits follow one another without an end."""
    process = in_a_process("""
        import sagnac
        told = []
        def progress(what, done, of):
            told.append(what)
            if len(told) == 3:
                print("ready", flush=True)
        try:
            while True:
                sagnac.calibrate(["cycle-1.csv.gz"], "bench.toml", model="auto", progress=progress)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        """)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGINT)
    said, errors = process.communicate()
    assert process.returncode == 0 and said.endswith("interrupted\n"), errors


def test_a_fork_works_on() -> None:
    process = in_a_process("""
        import os, sagnac, warnings
        warnings.simplefilter("ignore")
        fit = lambda: sagnac.calibrate(["cycle-1.csv.gz"], "bench.toml").to_json()
        before = fit()
        child = os.fork()
        if child == 0:
            os._exit(0 if fit() == before else 1)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), fit() == before)
        """)
    said, errors = process.communicate()
    assert said == "0 True\n", errors


COLUMNS = ["time_s", "time_ns", "counts", "counts_x", "rate_dph", "temperature_c", "temperature_c_block", "valid", "aux_v", "remark"]
VALUES = st.one_of(
    st.floats(width=64),
    st.integers(-(2**63), 2**63 - 1),
    st.sampled_from([0, 1, -1, 5.0, 25.0, 1e-300, 1e18, float("nan"), None]),
)


@st.composite
def tables(draw: st.DrawFn) -> dict[str, Any]:
    names = draw(st.lists(st.sampled_from(COLUMNS), unique=True, max_size=5))
    rows = draw(st.integers(0, 40))
    out: dict[str, Any] = {}
    for name in names:
        kind = draw(st.sampled_from(["ramp", "values", "noise", "text", "flags", "dates", "masked"]))
        if kind == "ramp":
            out[name] = numpy.arange(rows) * draw(st.floats(-100, 100)) + draw(st.floats(-1e6, 1e6))
        elif kind == "noise":
            out[name] = numpy.random.default_rng(draw(st.integers(0, 99))).normal(size=rows)
        elif kind == "text":
            out[name] = numpy.array(draw(st.lists(st.text(max_size=3), min_size=rows, max_size=rows)), dtype=object)
        elif kind == "flags":
            out[name] = numpy.arange(rows) % 2 == 0
        elif kind == "dates":
            out[name] = numpy.arange(rows).astype("datetime64[s]")
        elif kind == "masked":
            out[name] = numpy.ma.masked_array(numpy.arange(rows), mask=numpy.arange(rows) % 3 == 0)
        else:
            out[name] = draw(st.lists(VALUES, min_size=rows, max_size=rows))
    return out


@settings(max_examples=10_000, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
@given(tables(), st.sampled_from(["auto", "bias 1", "bias 3, rate 0"]), st.booleans())
def test_ten_thousand_tables(table: dict[str, Any], model: str, timed: bool) -> None:
    try:
        keys: dict[str, Any] = {} if timed else {"sample_interval_s": 5.0}
        made = sagnac.calibrate(table, arcsec_per_count=1.0, min_span_c=1.0, model=model, **keys)
    except sagnac.SagnacError as error:
        assert error.reason
        return
    assert made.to_json() and made.evaluate(20.0, axis=made.axes[0].axis).drift_dph.shape == ()


def test_paths_of_any_kind(tmp_path: Path, frames: list[polars.DataFrame]) -> None:
    frames[0].write_parquet(tmp_path / "run 1.parquet")
    for path in (tmp_path / "run 1.parquet", os.fspath(tmp_path / "run 1.parquet")):
        assert calibrated(path).to_dict()["provenance"]["inputs"][0]["file"].endswith("run 1.parquet")
