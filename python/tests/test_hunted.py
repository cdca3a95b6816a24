"""What a hunter found once: tables that were read otherwise than meant, and errors that did not help."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy
import pandas
import polars
import pyarrow
import pytest
from conftest import CHAMBER, MODEL, Program

import sagnac

BENCH = CHAMBER / "bench.toml"


def calibrated(runs: object, **keys: Any) -> sagnac.Calibration:
    return sagnac.calibrate(runs, BENCH, model=MODEL, **keys)


def as_csv(frame: pandas.DataFrame, folder: Path) -> Path:
    frame.to_csv(folder / "run.csv", index=False)
    return folder / "run.csv"


@pytest.fixture()
def frame(frames: list[polars.DataFrame]) -> pandas.DataFrame:
    return frames[0].to_pandas()


def test_counts_of_a_quantum_are_counts(frame: pandas.DataFrame, program: Program, tmp_path: Path) -> None:
    fine = frame.assign(counts=frame["counts"] / 4.0)
    path = as_csv(fine, tmp_path)
    unit = sagnac.calibrate(path, arcsec_per_count=0.605, quantum=0.25, model="bias 3", serial="Q")
    unit.save(tmp_path / "unit.cal.json")
    text = program("compensate", tmp_path / "unit.cal.json", path).decode().splitlines()
    rows = [line.split(",") for line in text if not line.startswith("#")]
    at = rows[0].index("compensated_counts")
    wanted = [float(row[at]) for row in rows[1:]]
    for run in (path, fine):
        assert unit.compensate(run)["counts_x"].tolist() == wanted


def test_missing_numbers_are_missing_whatever_holds_them(frame: pandas.DataFrame, tmp_path: Path) -> None:
    slow = frame.assign(temperature_c=frame["temperature_c"].where(numpy.arange(len(frame)) % 3 == 0))
    wanted = calibrated(as_csv(slow, tmp_path)).to_dict()["axes"]
    gone = slow["temperature_c"].isna().to_numpy()
    hidden = numpy.ma.masked_array(frame["temperature_c"].to_numpy(), mask=gone)
    texts = slow["temperature_c"].map(str).where(~gone, "NA")

    class Own(pandas.DataFrame):  # type: ignore[misc]
        pass

    tables: dict[str, Any] = {
        "NaN": slow,
        "nullable": slow.convert_dtypes(),
        "Arrow": slow.convert_dtypes(dtype_backend="pyarrow"),
        "masked": {name: hidden if name == "temperature_c" else frame[name].to_numpy() for name in frame},
        "polars NaN": polars.DataFrame({name: slow[name].to_numpy() for name in slow}),
        "polars null": polars.from_pandas(slow),
        "words": slow.assign(temperature_c=texts),
        "a class of one's own": Own(slow),
        "lists": {name: [None if value != value else value for value in slow[name].tolist()] for name in slow},
    }
    hashes = set()
    for form, table in tables.items():
        record = calibrated(table).to_dict()
        places = {str(axis["excluded"]) for axis in record["axes"]}
        for axis in (*record["axes"], *wanted):
            axis["excluded"] = []
        assert record["axes"] == wanted, (form, places)
        hashes.add(record["provenance"]["inputs"][0]["sha256"])
    assert len(hashes) == 1


def test_times_are_exact_and_in_their_unit(frame: pandas.DataFrame) -> None:
    ns = frame["time_s"].to_numpy() * 10**9 + 1_700_000_000_000_000_123
    forms = {
        "int64": ns,
        "uint64": ns.astype("uint64"),
        "nullable": pandas.Series(ns, dtype="Int64"),
        "Arrow": pandas.Series(ns, dtype="int64[pyarrow]"),
        "masked": numpy.ma.masked_array(ns),
        "polars": polars.Series(ns),
    }
    rest = {name: frame[name].to_numpy() for name in ("counts", "temperature_c")}
    hashes = {calibrated({"time_ns": times} | rest).to_dict()["provenance"]["inputs"][0]["sha256"] for times in forms.values()}
    assert len(hashes) == 1
    noise = numpy.random.default_rng(0).normal(0.0, 0.5, 20_000)
    since = pandas.to_timedelta(numpy.arange(1, 20_001) * 0.1, unit="s")
    for name in ("time_s", "time_ms", "time_us", "time_ns"):
        terms = sagnac.allan(pandas.DataFrame({name: since, "rate_dph": noise})).terms
        wanted = sagnac.allan(polars.DataFrame({name: polars.Series(since.to_numpy()), "rate_dph": noise})).terms
        assert terms == wanted, name
    with pytest.raises(sagnac.SagnacError, match="rate_dph"):
        sagnac.allan({"rate_dph": noise[:99].astype("m8[s]")}, sample_interval_s=0.1)
    days = {"rate_dph": noise[:300], "time_excel": numpy.arange(45351, 45651)}
    assert sagnac.allan(days).tau_s[0] == 86400.0


@pytest.mark.parametrize("year", ["3000-06-01", "1500-01-01"])
def test_dates_do_not_wrap(frame: pandas.DataFrame, year: str) -> None:
    times = numpy.datetime64(year, "s") + frame["time_s"].to_numpy().astype("m8[s]")
    table = {"time_iso": times} | {name: frame[name].to_numpy() for name in ("counts", "temperature_c")}
    with pytest.raises(sagnac.InputError, match="1678 to 2262"):
        calibrated(table)


def test_columns_that_are_not_read_refuse_nothing(frame: pandas.DataFrame) -> None:
    wanted = calibrated(frame).to_dict()["axes"]
    n = len(frame)
    strange: dict[str, Any] = {
        "remark": pandas.Series(["ok", *[numpy.nan] * (n - 1)], dtype=object),
        "bytes": numpy.array([b"\xb0C"] * n, dtype=object),
        "surrogate": ["\ud800"] * n,
        "years": numpy.arange(n).astype("m8[Y]"),
        "objects": [object()] * n,
        "complex": numpy.zeros(n, dtype=complex),
        "category": pandas.Categorical([1, 2] * (n // 2)),
        "arrow": pyarrow.array([None, *[True] * (n - 1)]),
        "zoned": pandas.date_range("2026-01-01", periods=n, freq="s", tz="Asia/Tokyo"),
    }
    table = {name: frame[name].to_numpy() for name in frame} | strange
    assert calibrated(table).to_dict()["axes"] == wanted
    for name in ("objects", "complex", "years"):
        with pytest.raises(sagnac.InputError) as raised:
            calibrated({"time_s": frame["time_s"], "temperature_c": frame["temperature_c"], "counts": strange[name]})
        assert "'counts'" in raised.value.reason and raised.value.help, str(raised.value)


def test_an_index_is_not_lost(frame: pandas.DataFrame) -> None:
    with pytest.raises(sagnac.InputError, match="reset_index"):
        calibrated(frame.set_index("time_s"))
    assert calibrated(frame.set_index("time_s").reset_index()).to_json() == calibrated(frame).to_json()
    assert calibrated(frame[frame["time_s"] > 0.0]).to_json() == calibrated(frame).to_json()


def test_masks_hide(frame: pandas.DataFrame) -> None:
    unit = calibrated(frame)
    found = unit.evaluate(numpy.ma.masked_array([20.0, -999.0], mask=[False, True])).drift_dph
    assert numpy.isnan(found).tolist() == [False, True]
    for wrong in ("20", None, True, numpy.array(["2026-01-01"], "M8[s]")):
        with pytest.raises(sagnac.InputError):
            unit.evaluate(wrong)  # type: ignore[arg-type]
    hidden = numpy.ma.masked_array([[2**24]], mask=[[True]])
    one, two = unit.compensator(), unit.compensator()
    assert one.run([1], hidden)[1].tolist() == two.run([1], [[-(2**31)]])[1].tolist() != [0]
    with pytest.raises(sagnac.InputError):
        one.run(numpy.ma.masked_array([1], mask=[True]), hidden)
    for wrong_call in (lambda: one.tick(2**31), lambda: unit.compensator().update([2**31]), lambda: unit.image(sequence=-1)):
        with pytest.raises(sagnac.InputError):
            wrong_call()
    assert one.run([], numpy.zeros((0, 1), dtype=int))[0].size == 0


def test_values_of_a_series(frame: pandas.DataFrame) -> None:
    values = numpy.random.default_rng(3).normal(0.0, 0.5, 5000)
    wanted = sagnac.allan(values, fs=10.0).adev
    for form in (pandas.Series(values), polars.Series(values), pyarrow.array(values), values.tolist()):
        assert numpy.array_equal(sagnac.allan(form, fs=10.0).adev, wanted)
        with pytest.raises(sagnac.InputError, match="sample rate|number above 0"):
            sagnac.allan(form)
    for keys in ({"fs": "10"}, {"fs": 10.0, "sample_interval_s": 5.0}, {"fs": 10.0, "taus": None}, {"fs": 10.0, "taus": ["a"]}):
        with pytest.raises(sagnac.InputError):
            sagnac.allan(values, **keys)
    for odd in (polars.Series(values), pandas.Series(values)):
        with pytest.raises(sagnac.InputError):
            calibrated(odd)
    del frame


def test_little_corrected_is_said(frame: pandas.DataFrame) -> None:
    unit = calibrated(frame)
    holes = frame.assign(counts=frame["counts"].where(numpy.arange(len(frame)) % 7 != 0))
    with pytest.warns(UserWarning, match="of 7920 rows are corrected"):
        unit.compensate(holes)


def test_lines_of_a_file_are_its_lines(frame: pandas.DataFrame, tmp_path: Path) -> None:
    unit = calibrated(frame)
    path = as_csv(frame, tmp_path)
    path.write_text("# a comment\n# another\n" + path.read_text())
    lines = unit.compensate(path)["line"]
    assert (lines[0], lines[-1], len(lines)) == (4, len(frame) + 3, len(frame))


def in_another_process(path: str) -> sagnac.Calibration:
    return sagnac.calibrate(path, BENCH, model=MODEL)


def test_results_travel() -> None:
    path = str(CHAMBER / "cycle-1.csv.gz")
    unit = calibrated(path)
    for again in (pickle.loads(pickle.dumps(unit)), copy.deepcopy(unit)):
        assert again.to_json() == unit.to_json()
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        (other,) = pool.map(in_another_process, [path])
    assert other.to_json() == unit.to_json()


def test_no_terminal_is_no_error(frame: pandas.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", None)
    assert calibrated(frame).axes
    assert calibrated(frame, progress=True).axes


def test_arguments_of_other_types_are_named(frame: pandas.DataFrame) -> None:
    unit = calibrated(frame)
    calls: list[Any] = [
        lambda: sagnac.calibrate(frame, BENCH, model=3),  # type: ignore[arg-type]
        lambda: calibrated(frame, warm_up="no"),
        lambda: calibrated(frame, columns="abc"),
        lambda: calibrated(frame, progress="no"),
        lambda: sagnac.compare(unit),  # type: ignore[arg-type]
        lambda: sagnac.compare(["a", "b"]),  # type: ignore[list-item]
        lambda: unit.verify(frame, {"sigma_over_floor_max": "x"}),
        lambda: calibrated({"time_s": 1.0, "counts": 2}),
        lambda: calibrated(b"cycle-1.csv.gz"),
    ]
    for call in calls:
        with pytest.raises(sagnac.SagnacError):
            call()
    assert 5 not in unit.windows  # type: ignore[comparison-overlap]
    names = {numpy.int64(0): "counts"}
    assert sagnac.calibrate(frame.rename(columns={"counts": 0}), BENCH, model=MODEL, columns=names).axes  # type: ignore[arg-type]
