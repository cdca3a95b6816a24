# %% [markdown]
# # A year of one unit
#
# A gyro is tested each quarter. Its bias differs from turn-on to turn-on, and in the autumn its curve over temperature has changed. Which of
# the differences are more than the tests' own uncertainty?

# %%
import numpy

import sagnac

random = numpy.random.default_rng(12)
row_s, arcsec_per_count = 5.0, 0.15125


def test(bias_dph: float, slope_dph: float) -> dict[str, numpy.ndarray]:
    """A triangle from 20 °C to −40, 70 and 20 °C at 1 °C/min with soaks, with the gyro's block 10 min behind the chamber."""
    chamber_c = numpy.interp(numpy.arange(0.0, 8.0 * 3600.0, row_s) / 60.0, [0, 60, 150, 260, 350, 400, 480], [20, -40, -40, 70, 70, 20, 20])
    block_c = numpy.empty_like(chamber_c)
    block_c[0] = chamber_c[0]
    for row in range(1, len(chamber_c)):
        block_c[row] = block_c[row - 1] + (chamber_c[row] - block_c[row - 1]) * row_s / 600.0
    u = (block_c - 15.0) / 55.0
    drift_dph = bias_dph + slope_dph * u - 0.05 * u**2
    angle_arcsec = (7.5 + drift_dph) * row_s + random.normal(0.0, 0.003 * 60.0 * numpy.sqrt(row_s), len(u))
    total = numpy.floor(numpy.cumsum(angle_arcsec) / arcsec_per_count)
    return {
        "time_s": row_s * numpy.arange(1, len(u) + 1),
        "temperature_c": block_c,
        "counts": numpy.diff(total, prepend=0.0),
    }


quarters = {"March": (0.02, 0.12), "June": (-0.05, 0.12), "September": (0.04, 0.12), "December": (0.01, 0.17)}
records = {
    month: sagnac.calibrate(test(*truth), arcsec_per_count=arcsec_per_count, model="bias 2", serial="RLG-0007")
    for month, truth in quarters.items()
}
for month, record in records.items():
    print(month, record.evaluate([-40.0, 70.0]).drift_dph)

# %% [markdown]
# The curve is compared, not the constant: that of each turn-on is its run's own.

# %%
first_three = sagnac.compare({month: records[month] for month in ("March", "June", "September")})
print(first_three)
whole_year = sagnac.compare(records)
print(whole_year)
assert first_three.passed

# %%
import matplotlib.pyplot as plt

_, axes = plt.subplots(figsize=(7.5, 4.0), layout="constrained")
grid = numpy.linspace(-40.0, 70.0, 100)
for month, record in records.items():
    curve = record.evaluate(grid)
    axes.fill_between(grid, curve.lower_dph, curve.upper_dph, alpha=0.3, lw=0)
    axes.plot(grid, curve.drift_dph, label=month)
axes.set(xlabel="temperature, °C", ylabel="drift, °/h", title="the curve of each quarter with its 95 % interval")
axes.legend(frameon=False);
