"""Figures of the reports, in matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._errors import InputError
from ._packages import need

if TYPE_CHECKING:
    from ._results import Calibration, NoiseBudget, Verification

BEFORE, AFTER, FIT = "#9aa5b1", "#1f6feb", "#d1242f"


def axes_of(ax: Any, rows: int = 1) -> list[Any]:
    """The axes given, or new ones one above the other."""
    if ax is not None:
        given = list(ax) if isinstance(ax, (list, tuple)) or hasattr(ax, "__iter__") else [ax]
        if len(given) < rows:
            raise InputError(f"{rows} axes are needed, {len(given)} are given", "ax", f"give {rows} axes, or none")
        return given
    plt = need("matplotlib.pyplot", "plots")
    _, made = plt.subplots(rows, 1, figsize=(7.5, 3.4 * rows), layout="constrained")
    return [made] if rows == 1 else list(made)


def calibration(of: Calibration, axis: str, ax: Any) -> list[Any]:
    """Drift over temperature with the fit and its 95 % interval; below it the residual over time."""
    numpy = need("numpy", "plots")
    drift, residual = axes_of(ax, 2)
    points = of.residuals(axis)
    temperature_c, before, after = points["temperature_c"], points["before_dph"], points["after_dph"]
    low, high = of.axis(axis).span_c
    grid = numpy.linspace(low, high, 200)
    curve = of.evaluate(grid, axis=axis)
    # Points are about their run's constant, the curve is zero at T0: both about their means over the points' temperatures.
    known = numpy.isfinite(temperature_c) & numpy.isfinite(before) & numpy.isfinite(after)
    at_points = of.evaluate(temperature_c[known], axis=axis).drift_dph
    shift = float(numpy.mean(before[known]) - numpy.mean(at_points)) if known.any() else 0.0
    drift.plot(temperature_c, before, ".", ms=3, color=BEFORE, label="windows, about their run's constant")
    drift.plot(grid, curve.drift_dph + shift, color=FIT, label="fit at rest")
    drift.fill_between(grid, curve.lower_dph + shift, curve.upper_dph + shift, color=FIT, alpha=0.2, lw=0, label="95 % interval")
    drift.set(xlabel="temperature, °C", ylabel="drift, °/h", title=f"axis {axis}: {of.axis(axis).model}")
    drift.legend(frameon=False, fontsize="small")
    residual.plot(points["hours"], before, ".", ms=3, color=BEFORE, label="as logged")
    residual.plot(points["hours"], after, ".", ms=3, color=AFTER, label="less the fit")
    residual.set(xlabel="hours of test", ylabel="rate, °/h", title=f"residual σ {of.axis(axis).residual_dph:.3g} °/h")
    residual.legend(frameon=False, fontsize="small")
    return [drift, residual]


def verification(of: Verification, axis: str, ax: Any) -> list[Any]:
    """Rate before and after the correction, over temperature."""
    (only,) = axes_of(ax)[:1]
    points = of.residuals(axis)
    judged = of.axis(axis)
    only.plot(points["temperature_c"], points["before_dph"], ".", ms=3, color=BEFORE, label=f"as logged, σ {judged.before_dph:.3g} °/h")
    only.plot(points["temperature_c"], points["after_dph"], ".", ms=3, color=AFTER, label=f"corrected, σ {judged.after_dph:.3g} °/h")
    verdict = {True: "limits met", False: "limits NOT met", None: "no limits given"}[judged.passed]
    only.set(xlabel="temperature, °C", ylabel="rate about the run's mean, °/h", title=f"axis {axis}: {verdict}")
    only.legend(frameon=False, fontsize="small")
    return [only]


def noise(of: NoiseBudget, axis: str, ax: Any) -> list[Any]:
    """Overlapping Allan deviation with its 95 % interval, and the terms that explain it."""
    (only,) = axes_of(ax)[:1]
    found = of.axis(axis)
    only.loglog(found.tau_s, found.adev_dph, color=AFTER, label="Allan deviation")
    only.fill_between(found.tau_s, found.lower_dph, found.upper_dph, color=AFTER, alpha=0.2, lw=0, label="95 % interval")
    terms = [f"{name} {term.value:.3g} {term.unit}" for name, term in found.terms.items() if term.value is not None]
    only.set(xlabel="τ, s", ylabel="Allan deviation, °/h", title=f"axis {axis}: " + (", ".join(terms) or "no term resolved"))
    only.grid(True, which="both", alpha=0.3)
    only.legend(frameon=False, fontsize="small")
    return [only]
