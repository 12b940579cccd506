#!/usr/bin/env bash
# npTDMS 1.13.0: big-endian arrays are written with their bytes as they lie, marked as little-endian
#
# Arrays that come from big-endian files (netCDF-3 through scipy, FITS, many measuring devices) keep that byte order
# in NumPy, where they compute like any other. TdmsWriter takes such an array without a word, takes the type from the
# first value (which NumPy hands out in native order), writes the array's own bytes, and the segment's header says
# little-endian: what is read back are other numbers. Integers are plausible ones (1 becomes 256), floats become
# less than 1e-300.
# TDMS itself knows big-endian segments, and the reader supports them. The documentation of the writer does not
# mention byte order.
#
# Seen:
#   written >i2 [1 2 3]      read [256 512 768]
#   written >i4 [1 2 3]      read [16777216 33554432 50331648]
#   written >f8 [1. 2. 3.]   read [3.03865e-319 3.16202e-322 1.04347e-320]
#   netCDF-3 by scipy: 21.5 goes in, 4.15e-317 comes out of the TDMS file
# The same arrays after .astype(dtype.newbyteorder("=")) are read back bit for bit.
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq npTDMS==1.13.0 numpy==2.2.6 scipy==1.15.3 || exit 2
"$temp/venv/bin/python" - <<'PY'
import io
import sys

import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter
from scipy.io import netcdf_file


def through_tdms(samples):
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("group", "channel", samples)])
    file.seek(0)
    return TdmsFile.read(file)["group"]["channel"][:]


def through_netcdf(samples):
    kept = io.BytesIO()
    file = netcdf_file(kept, "w")
    file.createDimension("time", len(samples))
    file.createVariable("temperature", "f8", ("time",))[:] = samples
    file.flush()
    kept.seek(0)
    return netcdf_file(kept, "r", mmap=False).variables["temperature"][:]


as_stated = True
for samples in (
    np.array([1, 2, 3], dtype=">i2"),
    np.array([1, 2, 3], dtype=">i4"),
    np.array([1.0, 2.0, 3.0], dtype=">f8"),
    through_netcdf([21.5, 21.75, 22.0]),
):
    read = through_tdms(samples)
    native = through_tdms(samples.astype(samples.dtype.newbyteorder("=")))
    print(f"{samples.dtype}  written {samples}  read {read}  native order {native}")
    swapped = samples.view(samples.dtype.newbyteorder("<"))
    as_stated &= np.array_equal(read, swapped) and not np.array_equal(read, samples)
    as_stated &= np.array_equal(native, samples)
sys.exit(0 if as_stated else 1)
PY
