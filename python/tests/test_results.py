"""Results: attributes, tables, plots, the gyro's processor, noise next to allantools."""

from __future__ import annotations

from pathlib import Path

import allantools
import matplotlib.pyplot
import numpy
import pandas
import polars
import pyarrow
import pytest
from conftest import CHAMBER, MODEL

import sagnac
from sagnac import _results

BENCH = CHAMBER / "bench.toml"


@pytest.fixture(scope="module")
def unit() -> sagnac.Calibration:
    return sagnac.calibrate([CHAMBER / "cycle-1.csv.gz", CHAMBER / "cycle-2.csv.gz"], BENCH, model=MODEL)


def test_attributes_are_the_records(unit: sagnac.Calibration) -> None:
    record = unit.to_dict()["axes"][0]
    axis = unit.axis()
    assert (axis.model, axis.reference_c, list(axis.span_c)) == (MODEL, record["reference_c"], record["span_c"])
    assert [term.value for term in axis.terms] == [term["value"] for term in record["terms"]]
    assert axis.residual_dph == record["residual"]["sigma_dph"] and axis.lag_s == record["lag_s"]["value"]
    assert f"{axis.residual_dph:.4g}" in repr(unit)
    html = unit._repr_html_()
    assert "<svg" in html and MODEL in html


def test_rates_are_read_in_other_units(unit: sagnac.Calibration) -> None:
    axis = unit.axis()
    assert axis.residual_dps == pytest.approx(axis.residual_dph / 3600.0)
    assert axis.residual_mdps == pytest.approx(1000.0 * axis.residual_dps)
    assert axis.residual_radps == pytest.approx(numpy.radians(axis.residual_dps))
    points = unit.evaluate([-40.0, 70.0])
    assert points.drift_dps == pytest.approx(points.drift_dph / 3600.0)
    for missing in ("residual_kmh", "nothing_dps", "model_dps"):
        with pytest.raises(AttributeError, match=missing):
            getattr(axis, missing)


def test_the_fixed_bias_goes_on_request(unit: sagnac.Calibration) -> None:
    runs = [CHAMBER / "cycle-1.csv.gz", CHAMBER / "cycle-2.csv.gz"]
    again = sagnac.calibrate(runs, BENCH, model=MODEL, remove_bias=True)
    kept, removed = (made.to_dict()["axes"][0] for made in (unit, again))
    bias = removed.pop("fixed_bias")
    assert bias["value_dph"] == pytest.approx(numpy.mean([run["fixed_bias_dph"] for run in kept["run_offsets"]]))
    assert bias["runs"] == 2 and removed == kept


def test_tables_go_everywhere(unit: sagnac.Calibration) -> None:
    table = unit.residuals()
    frame = polars.DataFrame(table)
    assert frame.columns == table.column_names and frame.height == table.rows == 792
    assert pyarrow.table(table).num_rows == 792
    assert pandas.DataFrame(dict(table)).shape == (792, 7)
    residual = table["after_dph"]
    assert residual.dtype == numpy.float64 and numpy.isfinite(residual).all()
    # One σ for 792 windows and the parameters of the fit.
    assert numpy.sqrt((residual**2).sum() / (792 - 7)) == pytest.approx(unit.axis().residual_dph, rel=0.01)
    windows = unit.windows
    assert {"run", "start_s", "rate_dph_z", "temperature_c"} <= set(windows)
    assert unit.candidates().to_pydict()["chosen"] == [1]
    with pytest.raises(KeyError):
        table["no such column"]


def test_a_compensator_is_the_processor(unit: sagnac.Calibration) -> None:
    random = numpy.random.default_rng(3)
    one, many = unit.compensator(), unit.compensator()
    # More than are copied at a time, and no whole number of updates.
    ticks = 17 * one.period_ticks // 2
    assert ticks > _results._TICKS_OF_A_PIECE > 3 * one.period_ticks
    counts = random.integers(-3, 9, ticks).astype(numpy.int32)
    codes = random.integers(-(2**24), 2**24, (9, one.inputs)).astype(numpy.int32)
    wanted, statuses = [], []
    for tick, count in enumerate(counts.tolist()):
        if tick % one.period_ticks == 0:
            statuses.append(one.update(codes[tick // one.period_ticks].tolist()))
        wanted.append(one.tick(count))
    found, bits = many.run(counts, codes)
    assert found.tolist() == wanted and len(bits) == len(statuses) == 9
    assert (one.status, one.period_ticks) == (many.status, 10_000)
    # Nothing changes where a call is refused.
    with pytest.raises(sagnac.SagnacError, match="due|update"):
        many.update([0] * one.inputs)
    with pytest.raises((sagnac.SagnacError, ValueError), match="no more codes"):
        many.run(numpy.ones(20_000, dtype=numpy.int32), codes[:0])
    beyond = numpy.ones(ticks, dtype=numpy.int32)
    beyond[70_000] = 2**29 + 1
    with pytest.raises(sagnac.SagnacError, match="counts in one call"):
        many.run(beyond, codes)
    for wrong in (numpy.ones((2, 2), dtype=int), numpy.ones(4), numpy.array([2**40])):
        with pytest.raises(sagnac.InputError):
            many.run(wrong, codes)
    rest = numpy.ones(100, dtype=numpy.int32)
    assert many.run(rest, codes[:0])[0].tolist() == [one.tick(1) for _ in range(100)]
    missing = unit.compensator()
    assert missing.update([None] * missing.inputs) != "ok"


def test_noise_is_that_of_allantools() -> None:
    random = numpy.random.default_rng(5)
    n, fs = 200_000, 10.0
    # White noise of 0.003 °/√h and a random walk of the rate.
    rate_dph = random.normal(0.0, 0.003 * 60.0 * numpy.sqrt(fs), n) + numpy.cumsum(random.normal(0.0, 2e-4, n))
    found = sagnac.allan(rate_dph, fs=fs, taus="octave", exact=True)
    taus, wanted, _, _ = allantools.oadev(rate_dph, rate=fs, data_type="freq", taus=found.tau_s)
    assert len(taus) == len(found.tau_s) > 12
    assert numpy.allclose(found.adev, wanted, rtol=1e-9)
    angle_random_walk = found.terms["N"]
    assert angle_random_walk.lower is not None and angle_random_walk.upper is not None
    assert angle_random_walk.lower < 0.003 < angle_random_walk.upper and angle_random_walk.unit == "°/√h"
    assert found.terms["Q"].value is None and found.terms["Q"].unresolved
    given = sagnac.allan({"rate_dph": rate_dph, "time_s": numpy.arange(1, n + 1) / fs}, taus=[1.0, 10.0])
    assert given.tau_s.tolist() == [1.0, 10.0]
    assert "N 0.003" in repr(found) or "N 0.0029" in repr(found)


def test_plots_answer_with_the_reports_words(unit: sagnac.Calibration, tmp_path: Path) -> None:
    drift, residual = unit.plot()
    assert drift.get_xlabel() == "temperature, °C" and MODEL in drift.get_title()
    low, high = unit.axis().span_c
    fit = next(line for line in drift.lines if line.get_label() == "fit at rest")
    assert (fit.get_xdata()[0], fit.get_xdata()[-1]) == (low, high)
    wanted = unit.evaluate(fit.get_xdata()).drift_dph
    assert numpy.allclose(numpy.diff(fit.get_ydata()), numpy.diff(wanted))
    proof = unit.verify(CHAMBER / "retest.csv.gz", CHAMBER / "limits.toml")
    figure, axes = matplotlib.pyplot.subplots(2, 1)
    assert proof.plot(ax=axes[0])[0] is axes[0] and "limits met" in axes[0].get_title()
    noise = sagnac.allan(CHAMBER / "cycle-1.csv.gz", BENCH)
    assert noise.plot(ax=axes[1])[0].get_ylabel() == "Allan deviation, °/h"
    figure.savefig(tmp_path / "plots.png")
    assert (tmp_path / "plots.png").stat().st_size > 10_000
    with pytest.raises(sagnac.InputError, match="2 axes"):
        unit.plot(ax=axes[0])
    matplotlib.pyplot.close("all")


def test_reports_of_all_kinds(unit: sagnac.Calibration, tmp_path: Path) -> None:
    noise, compared = sagnac.allan(CHAMBER / "cycle-1.csv.gz", BENCH), sagnac.compare([unit, unit])
    for number, write in enumerate([unit.report, noise.report, compared.report]):
        path = tmp_path / f"{number}.html"
        write(path)
        assert path.read_text().startswith("<!DOCTYPE html>")
    with pytest.raises(sagnac.InputError, match="cannot write"):
        unit.report(tmp_path / "no-such-folder" / "report.html")
