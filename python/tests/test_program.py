"""The package gives what the program gives: the same bytes for the same input."""

from __future__ import annotations

import json
from pathlib import Path

import numpy
import polars
import pytest
from conftest import MODEL, ROOT, Program

import sagnac

RUNS = ["cycle-1.csv.gz", "cycle-2.csv.gz"]
pytestmark = pytest.mark.usefixtures("in_chamber")


@pytest.fixture()
def unit() -> sagnac.Calibration:
    return sagnac.calibrate(RUNS, "bench.toml", model=MODEL)


@pytest.fixture()
def record(program: Program, tmp_path: Path) -> Path:
    path = tmp_path / "unit.cal.json"
    program("calibrate", *RUNS, "--setup", "bench.toml", "--model", MODEL, "-o", path)
    return path


def test_records_are_the_programs(unit: sagnac.Calibration, record: Path, tmp_path: Path) -> None:
    assert unit.to_json().encode() == record.read_bytes()
    unit.save(tmp_path / "again.cal.json")
    assert (tmp_path / "again.cal.json").read_bytes() == record.read_bytes()
    assert sagnac.Calibration.read(record).to_json() == unit.to_json()


def test_a_search_is_the_programs(program: Program) -> None:
    found = sagnac.calibrate(RUNS, "bench.toml")
    wanted = program("calibrate", *RUNS, "--setup", "bench.toml", "--json")
    assert found.to_json().encode() == wanted


def test_keys_are_those_of_a_setup_file(program: Program) -> None:
    found = sagnac.calibrate(RUNS, {"arcsec_per_count": 0.15125, "window": 50.0}, serial="RLG-9", axis="y", model="bias 2")
    words = "--arcsec-per-count 0.15125 --window 50 --serial RLG-9 --axis y --model".split()
    assert found.to_json().encode() == program("calibrate", *RUNS, *words, "bias 2", "--json")


def test_a_table_of_windows_is_no_log(program: Program, tmp_path: Path) -> None:
    program("inspect", *RUNS, "--setup", "bench.toml", "--windows", tmp_path / "windows.parquet")
    with pytest.raises(sagnac.InputError, match="this is a table of windows, not a log"):
        sagnac.calibrate(tmp_path / "windows.parquet", model=MODEL)


def test_results_are_no_logs(unit: sagnac.Calibration, tmp_path: Path) -> None:
    unit.save(tmp_path / "unit.cal.json")
    (tmp_path / "unit.img").write_bytes(unit.image())
    for path in (tmp_path / "unit.cal.json", tmp_path / "unit.img"):
        with pytest.raises(sagnac.InputError, match="a log is needed"):
            sagnac.calibrate(path)


def test_verifications_are_the_programs(unit: sagnac.Calibration, record: Path, program: Program) -> None:
    for limits in ("limits.toml", "navigation-grade", None):
        words = [] if limits is None else ["--limits", limits]
        proof = unit.verify("retest.csv.gz", limits)
        assert proof.to_json().encode() == program("verify", record, "retest.csv.gz", *words, "--json")
        assert proof.passed
    strict = unit.verify("retest.csv.gz", {"sigma_over_floor_max": 0.5})
    assert not strict.passed and strict.axes[0].passed is False
    assert [limit.name for limit in strict.axes[0].limits if limit.met is False] == ["sigma_over_floor_max"]
    assert "NOT MET" in repr(strict)


def test_a_log_of_the_fit_is_no_proof(unit: sagnac.Calibration, frames: list[polars.DataFrame]) -> None:
    for own in ("cycle-1.csv.gz", frames[0]):
        proof = unit.verify(own, "limits.toml")
        assert not proof.passed and proof.to_dict()["training_overlap"]


def test_reports_are_the_programs(unit: sagnac.Calibration, record: Path, program: Program, tmp_path: Path) -> None:
    program("calibrate", *RUNS, "--setup", "bench.toml", "--model", MODEL, "--report", tmp_path / "program.html")
    unit.report(tmp_path / "package.html")
    assert (tmp_path / "package.html").read_bytes() == (tmp_path / "program.html").read_bytes()
    program("verify", record, "retest.csv.gz", "--limits", "limits.toml", "--report", tmp_path / "proof.html")
    unit.verify("retest.csv.gz", "limits.toml").report(tmp_path / "package.html")
    assert (tmp_path / "package.html").read_bytes() == (tmp_path / "proof.html").read_bytes()
    with pytest.raises(sagnac.InputError, match="no windows"):
        sagnac.Calibration.read(record).report(tmp_path / "none.html")


def test_corrected_counts_are_the_programs(unit: sagnac.Calibration, record: Path, program: Program) -> None:
    wanted = program("compensate", record, "retest.csv.gz").decode().splitlines()
    rows = [line for line in wanted if not line.startswith("#")]
    at = rows[0].split(",").index("compensated_counts")
    counts = [int(row.split(",")[at]) for row in rows[1:]]
    found = unit.compensate("retest.csv.gz")
    assert found["counts_z"].tolist() == counts
    # A line of headers is above them.
    assert found["line"].tolist() == list(range(2, len(counts) + 2))


def test_images_and_sources_are_the_programs(unit: sagnac.Calibration, record: Path, program: Program, tmp_path: Path) -> None:
    program("export", record, "--to", "image", "-o", tmp_path / "unit.img")
    assert unit.image() == (tmp_path / "unit.img").read_bytes()
    program("export", record, "--to", "c", "-o", tmp_path / "program")
    paths = [Path(path) for path in unit.export_c(tmp_path / "package")]
    names = sorted(path.relative_to(tmp_path / "package") for path in paths)
    assert names == sorted(p.relative_to(tmp_path / "program") for p in (tmp_path / "program").rglob("*") if p.is_file())
    for name in names:
        assert (tmp_path / "package" / name).read_bytes() == (tmp_path / "program" / name).read_bytes()
    (tmp_path / "package" / "README.md").write_text("mine\n")
    with pytest.raises(sagnac.InputError, match="would overwrite a file"):
        unit.export_c(tmp_path / "package")


def test_noise_is_the_programs(program: Program) -> None:
    wanted = program("allan", "cycle-1.csv.gz", "--setup", "bench.toml", "--taus", "octave", "--json")
    assert sagnac.allan("cycle-1.csv.gz", "bench.toml", taus="octave").to_json().encode() == wanted


def test_comparisons_are_the_programs(unit: sagnac.Calibration, record: Path, program: Program, tmp_path: Path) -> None:
    other = sagnac.calibrate(["retest.csv.gz"], "bench.toml", model=MODEL)
    other.save(tmp_path / "other.cal.json")
    wanted = program("compare", record, tmp_path / "other.cal.json", "--json")
    found = sagnac.compare({str(record): unit, str(tmp_path / "other.cal.json"): other})
    assert found.to_json().encode() == wanted
    assert found.words and found.passed


def test_simulations_are_the_programs(program: Program, tmp_path: Path) -> None:
    scenario = ROOT / "scenarios/paper/paper.toml"
    text = program("simulate", scenario, "--seed", 7)
    wanted = polars.read_csv(text, infer_schema_length=None)
    found = sagnac.simulate(scenario, seed=7)
    assert found.column_names == wanted.columns
    for name in wanted.columns:
        assert numpy.array_equal(found[name], wanted[name].to_numpy().astype(float), equal_nan=True), name
    # What is simulated is calibrated like any log.
    (tmp_path / "run.csv").write_bytes(text)
    of_table, of_file = (
        sagnac.calibrate(run, arcsec_per_count=1.059, model="bias 2").to_dict() for run in (found, tmp_path / "run.csv")
    )
    assert of_table["axes"] == json.loads(json.dumps(of_file["axes"]))


def test_evaluations_are_the_programs(unit: sagnac.Calibration, record: Path, program: Program) -> None:
    at = [-40.0, -3.25, 25.0, 70.0, 90.0]
    given = program("evaluate", record, "--at", ",".join(map(str, at)), "--rate-cpm", "0.5", "--json")
    points = json.loads(given)["axes"][0]["points"]
    found = unit.evaluate(at, 0.5)
    for name in ("drift_dph", "lower_dph", "upper_dph", "scale_ppm", "in_span"):
        assert getattr(found, name).tolist() == [point[name] for point in points], name
    square = unit.evaluate(numpy.array([[0.0, 10.0], [20.0, 30.0]]), numpy.array([0.0, 1.0]))
    assert square.drift_dph.shape == (2, 2) and (square.lower_dph < square.upper_dph).all()
