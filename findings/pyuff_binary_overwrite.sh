#!/usr/bin/env bash
# pyuff 2.5.8: writing binary with mode "overwrite" loses the first function, and a file of one function altogether
#
# write_sets(sets, "overwrite") with data sets of type 58 and binary=1 ends without an error, but the first set is not
# in the file: after the binary part the file is opened once more as text with the same mode, which truncates it, and
# only the closing "-1" is left of it. One set gives a file of 7 bytes; of more sets all but the first are kept. The
# same call with binary=0 writes them all, and so does mode "add" with binary=1. The docstring of write_sets names
# both modes and makes no exception for binary data.
#
# Seen (functions of 50 points, real, evenly spaced):
#                       sets written   bytes   sets in the file
#   binary, overwrite         1            7          0
#   binary, overwrite         3         2651          2
#   binary, add               3         3966          3
#   ASCII, overwrite          3         5808          3
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" && "$temp/venv/bin/pip" install -qq pyuff==2.5.8 numpy==2.2.6 || exit 2
"$temp/venv/bin/python" - "$temp" <<'PY'
import sys
from pathlib import Path

import numpy as np
import pyuff

EMPTY = ("id2", "id3", "id4", "id5", "rsp_ent_name", "ref_ent_name")
LABELS = ("orddenom_axis_units_lab", "z_axis_axis_units_lab")


def function(binary):
    """A displacement over time at node 1."""
    return pyuff.prepare_58(
        binary=binary, func_type=1, id1="displacement", rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1,
        ver_num=0, load_case_id=0, abscissa_spacing=1, abscissa_min=0.0, abscissa_inc=0.01, z_axis_value=0.0,
        abscissa_spec_data_type=17, ordinate_spec_data_type=8, orddenom_spec_data_type=0, z_axis_spec_data_type=0,
        abscissa_axis_units_lab="s", ordinate_axis_units_lab="m", x=np.arange(50) * 0.01,
        data=np.sin(np.arange(50) * 0.1), **dict.fromkeys(EMPTY + LABELS, ""),
    )  # fmt: skip


as_stated = True
for binary, mode, count, kept in (
    (1, "overwrite", 1, 0),
    (1, "overwrite", 3, 2),
    (1, "add", 3, 3),
    (0, "overwrite", 1, 1),
    (0, "overwrite", 3, 3),
):
    file = Path(sys.argv[1]) / f"{binary}_{mode}_{count}.uff"
    pyuff.UFF(str(file)).write_sets([function(binary) for _ in range(count)], mode)
    found = pyuff.UFF(str(file)).get_n_sets()
    print(f"binary={binary} {mode:9}  {count} written, {file.stat().st_size:4} bytes, {found} in the file")
    as_stated &= found == kept
sys.exit(0 if as_stated else 1)
PY
