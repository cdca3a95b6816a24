# %% [markdown]
# # From a data frame to an accepted unit
#
# Two thermal cycles of a ring laser gyro are in pandas data frames: counts of 0.15125 arcsec each 5 s, and the block's temperature. We
# calibrate the gyro, prove the calibration on a retest, and take the flash image for its processor.

# %%
from pathlib import Path

import pandas

import sagnac

chamber = next(folder / "testdata/chamber" for folder in Path.cwd().parents if (folder / "testdata/chamber").is_dir())
cycles = [pandas.read_csv(chamber / f"cycle-{number}.csv.gz") for number in (1, 2)]
retest = pandas.read_csv(chamber / "retest.csv.gz")
cycles[0].head()

# %% [markdown]
# Facts that a log does not contain are the keys of a setup file: here the size of a count, the axis and the serial number. The model is
# searched for; held-out stretches of the test decide.

# %%
unit = sagnac.calibrate(cycles, arcsec_per_count=0.15125, axis="z", serial="RLG-0001", reference_c=25.0)
print(unit)
pandas.DataFrame(dict(unit.candidates())).sort_values(["chosen", "held_out_dph"], ascending=[False, True]).head(5)

# %% [markdown]
# The fit at rest with its 95 % interval, and what is not explained: the noise floor of a window of 100 s is 0.018 °/h.

# %%
unit.plot();

# %% [markdown]
# Drift at temperatures that were tested, with its interval; beyond the span of the test the correction is that at the border.

# %%
at = unit.evaluate([-40.0, 0.0, 70.0, 90.0])
pandas.DataFrame({"°C": at.temperature_c, "drift, °/h": at.drift_dph, "from": at.lower_dph, "to": at.upper_dph, "in span": at.in_span})

# %% [markdown]
# The proof is a test that the fit has not seen, replayed through the image that ships, in the integers of the gyro's processor.

# %%
proof = unit.verify(retest, "navigation-grade")
print(proof)
proof.plot();

# %%
assert proof.passed
# A log of the fit is no proof, whatever its figures are.
assert not unit.verify(cycles[0], "navigation-grade").passed

# %% [markdown]
# What the processor would have counted, and the image that makes it do so.

# %%
corrected = unit.compensate(retest)
image = unit.image()
print(corrected, len(image), "bytes")
