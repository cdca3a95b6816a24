"""The package next to its peers, in pairs in one process: `cargo xtask bench python`. Prints a section of docs/explanation/performance.md."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import allantools
import numpy
import pandas
import polars

import sagnac

ROWS = 10_000_000
PAIRS = 5


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


#: Figures that were not reached.
missed: list[str] = []


def figure(name: str, value: float, asked: float, at_least: bool = True) -> float:
    """A figure, remembered where it is not reached."""
    if (value < asked) if at_least else (value > asked):
        missed.append(f"{name} ({value:.3g} of {asked:g})")
    return value


def paired(name: str, ours: Callable[[], object], peer: Callable[[], object], target: float | None) -> str:
    """A row: medians of alternating runs, and of their ratios."""
    runs = [(seconds(ours), seconds(peer)) for _ in range(PAIRS)]
    mine, theirs = (statistics.median(run[side] for run in runs) for side in (0, 1))
    ratio = statistics.median(theirs / mine for mine, theirs in runs)
    asked = "" if target is None else f"{target:g}"
    if target is not None:
        figure(name.partition(";")[0], ratio, target)
    return f"| {name} | {mine:.2f} | {theirs:.2f} | {ratio:.2f} | {asked} |"


def log() -> dict[str, numpy.ndarray]:
    """A triangle over temperature, a row each 10 ms."""
    random = numpy.random.default_rng(10)
    time_s = numpy.arange(1, ROWS + 1) / 100.0
    temperature_c = numpy.interp(time_s % 20_000.0, [0, 10_000, 20_000], [-40.0, 70.0, -40.0])
    counts = numpy.floor(50.0 + 0.5 * temperature_c / 70.0 + random.random(ROWS)).astype("i8")
    return {"time_s": time_s, "temperature_c": temperature_c, "counts": counts}


def numpy_fit(temperature_c: numpy.ndarray, counts: numpy.ndarray) -> object:
    y = counts.astype(float)
    fit = numpy.polynomial.chebyshev.Chebyshev.fit(temperature_c, y, 3)
    return fit.coef, (y - fit(temperature_c)).std()


#: What a calibration of a table in memory adds to the process at its peak, MiB.
ADDED = """
import sys, gc, numpy
sys.path.insert(0, {folder!r})
import bench, sagnac, polars, pandas
table = {table}
small = {{name: values[:200_000] for name, values in bench.log().items()}}
def high():
    return int(next(line for line in open('/proc/self/status') if line.startswith('VmHWM')).split()[1]) / 1024
def calibrate(of):
    sagnac.calibrate(of, arcsec_per_count=0.15, model='bias 3', serial='B', min_span_c=1.0)
gc.collect()
open('/proc/self/clear_refs', 'w').write('5')
before = high()
calibrate(table)
print(high() - before)
"""
TABLES = {"polars": "polars.DataFrame(bench.log())", "pandas": "pandas.DataFrame(bench.log())", "numpy": "bench.log()"}


def added_mib(table: str) -> float:
    code = ADDED.format(folder=str(Path(__file__).parent), table=TABLES[table])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return float(done.stdout)


def import_ms() -> float:
    """An import, next to a start of Python without it."""

    def start(code: str) -> float:
        return seconds(lambda: subprocess.run([sys.executable, "-c", code], check=True))

    pairs = [start("import sagnac") - start("pass") for _ in range(2 * PAIRS + 1)]
    return 1000.0 * statistics.median(pairs)


def main() -> None:
    noise = numpy.random.default_rng(1).normal(size=ROWS)
    taus = [float(tau) for tau in numpy.unique(numpy.logspace(0, 6, 112).astype(int))[:100]]
    print("## In Python, on 10 million values in memory\n")
    print("Made by `cargo xtask bench python`. Seconds are of the wall, medians of alternating runs in one process.\n")
    print("| task | Sagnac, s | peer, s | peer over Sagnac | to reach |\n|---|---|---|---|---|")
    octaves = paired(
        "`allan`, octaves, with its terms; allantools `oadev`",
        lambda: sagnac.allan(noise, fs=1.0, taus="octave"),
        lambda: allantools.oadev(noise, rate=1.0, data_type="freq", taus="octave"),
        8.0,
    )
    print(octaves, flush=True)
    hundred = paired(
        "`allan`, 100 τ, with its terms; allantools `oadev`",
        lambda: sagnac.allan(noise, fs=1.0, taus=taus),
        lambda: allantools.oadev(noise, rate=1.0, data_type="freq", taus=taus),
        10.0,
    )
    print(hundred, flush=True)
    columns = log()
    frames = {"polars": polars.DataFrame(columns), "pandas": pandas.DataFrame(columns)}
    for name, frame in frames.items():

        def ours(frame: object = frame) -> object:
            return sagnac.calibrate(frame, arcsec_per_count=0.15, model="bias 3", serial="B")

        def peer(frame: object = frame) -> object:
            t, y = (frame[column].to_numpy() for column in ("temperature_c", "counts"))  # type: ignore[index]
            return numpy_fit(t, y)

        print(paired(f"`calibrate` of a {name} frame; numpy's fit of its columns", ours, peer, None), flush=True)
    processor = sagnac.calibrate(frames["polars"], arcsec_per_count=0.15, model="bias 3", serial="B").compensator()
    codes = numpy.full((ROWS // processor.period_ticks + 1, processor.inputs), 2**24, dtype="i4")
    counts = columns["counts"].astype("i4")
    rate = statistics.median(ROWS / seconds(lambda: sagnac_run(processor, counts, codes)) for _ in range(PAIRS))
    figure("million ticks a second", rate / 1e6, 100.0)
    print(f"\n`Compensator.run`: {rate / 1e6:.0f} million ticks a second on one core (to reach: 100).")
    added = ", ".join(f"{name} {figure(f'MiB beside {name}', added_mib(name), 64.0, False):.0f}" for name in TABLES)
    print(f"Memory that `calibrate` adds to that of the table, MiB: {added} (to reach: 64).")
    print(f"Import: {figure('ms of an import', import_ms(), 100.0, False):.0f} ms (to reach: 100).\n")
    print(f"Missed: {', '.join(missed)}." if missed else "Every figure is reached.")
    print(
        "Ticks and import are of this machine alone. Of the time of `allan` at octaves, differences and their squares are an eighth; hashing and\n"
        "copying the array, checking each row, looking for disturbed ones (a median of the record), and five terms with intervals are the rest,\n"
        "which `oadev` does not do."
    )


def sagnac_run(processor: sagnac.Compensator, counts: numpy.ndarray, codes: numpy.ndarray) -> object:
    return processor.run(counts, codes)


if __name__ == "__main__":
    main()
