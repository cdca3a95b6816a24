"""Reference for crates/sagnac/tests/real_chamber.rs: numpy's cubic on all rows of the recording.

usage: python3 numpy_cubic.py ../../../shared/data/mems-chamber-sweep/imu_raw_data.csv
"""

import sys

import numpy

table = numpy.genfromtxt(sys.argv[1], delimiter="\t", names=True, deletechars="")
print("numpy", numpy.__version__)
for axis in "xyz":
    powers = numpy.polyfit(table["imu.temperature"], table["imu.gyro." + axis], 3)
    print(axis, ", ".join(f"{power:.12e}" for power in powers))
