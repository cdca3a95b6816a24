# %% [markdown]
# # Noise of a record, next to allantools
#
# Three hours of a gyro at rest, 10 values a second: angle random walk of 0.003 °/√h, and a rate random walk below it. The Allan deviations
# are those of allantools; the terms, their intervals and what cannot be resolved are ours.

# %%
import allantools
import matplotlib.pyplot as plt
import numpy

import sagnac

random = numpy.random.default_rng(647)
fs, hours = 10.0, 3.0
n = int(fs * 3600.0 * hours)
white_dph = random.normal(0.0, 0.003 * 60.0 * numpy.sqrt(fs), n)
walk_dph = numpy.cumsum(random.normal(0.0, 0.02 / numpy.sqrt(3600.0 * fs), n))
rate_dph = white_dph + walk_dph

# %%
noise = sagnac.allan(rate_dph, fs=fs, taus="octave", exact=True)
print(noise)
for name, term in noise.terms.items():
    print(name, term.unresolved or f"{term.value:.3g} {term.unit}, 95 %: {term.lower:.3g} … {term.upper:.3g}")

# %%
taus, adev, _, _ = allantools.oadev(rate_dph, rate=fs, data_type="freq", taus=noise.tau_s)
assert numpy.allclose(noise.adev, adev, rtol=1e-9)
_, axes = plt.subplots(figsize=(7.5, 4.0), layout="constrained")
noise.plot(ax=axes)
axes.loglog(taus, adev, "k+", label="allantools.oadev")
axes.legend(frameon=False);

# %% [markdown]
# A term is stated only where the record resolves it. The true angle random walk lies within its interval:

# %%
angle_random_walk = noise.terms["N"]
assert angle_random_walk.lower < 0.003 < angle_random_walk.upper
