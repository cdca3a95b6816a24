"""Writes the rows of a log as files of other programs, each by the package that is at home in its format.

The names in the files are those of docs/how-to/other-tools.md. Usage: make.py LOG.csv FOLDER
"""

import os
import sqlite3
import struct
import sys

import h5py
import numpy
import pandas
import scipy.io
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter

log = pandas.read_csv(sys.argv[1])
folder = sys.argv[2]
time_s = log["time_s"].to_numpy().astype(float)
temperature_c = log["temperature_c"].to_numpy().astype(float)
counts = log["counts"].to_numpy()


def path(name, file):
    os.makedirs(os.path.join(folder, name), exist_ok=True)
    return os.path.join(folder, name, file)


def hdf5(where, names, shape, **options):
    with h5py.File(where, "w", **options) as file:
        for name, values in zip(names, (time_s, temperature_c, counts.astype(float))):
            file.create_dataset(name, data=values.reshape(shape), chunks=True, compression="gzip")
        file.create_dataset("soak_c", data=[-40.0, 70.0])


# A vector of another length, a number and a word stand beside the log, as they do in a workspace.
matlab = {"t": time_s, "T": temperature_c, "counts": counts.astype(float)}
beside = {"soak_c": [-40.0, 70.0], "gain": 1.0, "operator": "A. N. Other"}
scipy.io.savemat(path("matlab-5", "log.mat"), matlab | beside, do_compression=True)

hdf5(path("hdf5", "log.h5"), ("time_s", "temperature_c", "counts"), (-1,))

# MATLAB 7.3 is HDF5 behind 512 bytes of its own, with a vector as a matrix of one row.
where = path("matlab-7.3", "log.mat")
hdf5(where, matlab, (1, -1), userblock_size=512)
head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Thu Jan  1 00:00:00 2026 HDF5 schema 1.00 ."
with open(where, "r+b") as file:
    file.write(head.ljust(116) + bytes(8) + b"\x00\x02IM")

# In two segments, as LabVIEW appends while it measures.
with TdmsWriter(path("tdms", "log.tdms")) as file:
    for rows in (slice(None, 5000), slice(5000, None)):
        file.write_segment([
            ChannelObject("Chamber", "Time", time_s[rows]),
            ChannelObject("Chamber", "T_Block", temperature_c[rows]),
            ChannelObject("Gyro", "Counts", counts[rows]),
        ])

# Each signal has times of its own, as on a bus: the thermometer's message comes 0.7 s before the gyro's.
with MDF(version="4.10") as file:
    file.append(Signal(temperature_c, time_s - 0.7, name="BlockTemp", unit="degC"))
    file.append(Signal(counts, time_s, name="GyroCounts"))
    file.save(path("mdf", "log.mf4"), overwrite=True, compression=2)

# A DataFlash log begins with the formats of its messages; IMU is as ArduPilot's own, of two sensors in turn.
# pymavlink reads such logs and has no writer.
imu = struct.Struct("<3BQB6f2If2B2H")
labels = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"
rates_radps = numpy.float32(counts * numpy.deg2rad(0.15125 / 3600) / 5)
axes = (numpy.roll(rates_radps, 1), numpy.roll(rates_radps, 2), rates_radps)


def message_format(kind, length, name, form, columns):
    texts = (text.encode() for text in (name, form, columns))
    return struct.pack("<5B4s16s64s", 0xA3, 0x95, 0x80, kind, length, *texts)


with open(path("ardupilot", "log.bin"), "wb") as file:
    file.write(message_format(0x80, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"))
    file.write(message_format(0x81, imu.size, "IMU", "QBffffffIIfBBHH", labels))
    for second, celsius, *rates in zip(time_s, temperature_c, *axes):
        for sensor in range(2):
            values = (*rates, 0, 0, -9.8, 0, 0, celsius + 5 * sensor, 1, 1, 1000, 1000)
            file.write(imu.pack(0xA3, 0x95, 0x81, int(second * 1e6), sensor, *values))

# What the IMU measured, as plain text: each rate as the number of 32 bits that the log holds.
rates = {f"rate_radps_{axis}": values.astype(float) for axis, values in zip("xyz", axes)}
pandas.DataFrame({"time_s": time_s, "temperature_c": temperature_c} | rates).to_csv(path("ardupilot", "plain.csv"), index=False)

log.to_excel(path("excel", "log.xlsx"), index=False)
with sqlite3.connect(path("sqlite", "log.db")) as base:
    log.to_sql("cycle_1", base, index=False, if_exists="replace")
