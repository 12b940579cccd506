#!/usr/bin/env bash
# daqp 0.11.0: a solve after an update that crossed two bounds switches that row off in every later solve
#
# A row whose lower bound lies above its upper one makes a QP infeasible. Model.update() says so, with a negative
# flag, as its docstring promises ("0 on success, negative on failure"). solve() does not: it leaves the row out and
# returns exitflag 1 ("> 0 success"). What no text says: the row then stays out. The next update() hands over valid
# bounds and returns 0, solve() returns exitflag 1, and its point breaks those bounds by any amount, until sense, H
# or A is handed over again. In a controller that updates its bounds every cycle and looks at the exitflag, one
# crossing by rounding is enough. Without the solve() in between, or with two rows in conflict in place of one
# crossed row, later solves are right.
#
#   minimise 1/2 |x|^2 - 3 x0 - 3 x1   subject to  -1 <= x <= 1,  -s <= x0 + x1 <= s
#
# Seen:
#   setup  s = 1.5             x = [0.75 0.75]  exitflag 1
#   update s = -2     flag -1  x = [1. 1.]      exitflag 1   (infeasible)
#   update s = 0.5    flag 0   x = [1. 1.]      exitflag 1   x0 + x1 = 2, allowed 0.5
#   update s = 0.4    flag 0   x = [1. 1.]      exitflag 1   x0 + x1 = 2, allowed 0.4
#   update sense = 0  flag 0   x = [0.2 0.2]    exitflag 1   (right again)
# A fresh model with s = 0.4 gives [0.2 0.2].
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" && "$temp/venv/bin/pip" install -qq daqp==0.11.0 numpy==2.2.6 || exit 2
"$temp/venv/bin/python" - <<'PY'
import sys

import daqp
import numpy as np

H, f, A = np.eye(2), np.array([-3.0, -3.0]), np.array([[1.0, 1.0]])


def bounds(s):
    return {"bupper": np.array([1.0, 1.0, s]), "blower": np.array([-1.0, -1.0, -s])}


def solve(model):
    x, _, exitflag, _ = model.solve()
    return x.round(6).tolist(), exitflag


model = daqp.Model()
model.setup(H, f, A, sense=np.zeros(3, dtype=np.int32), **bounds(1.5))
seen = [("setup, s = 1.5", solve(model))]
for s in (-2.0, 0.5, 0.4):
    seen.append((f"s = {s}", (model.update(**bounds(s)), *solve(model))))
seen.append(("sense handed over", (model.update(sense=np.zeros(3, dtype=np.int32)), *solve(model))))
fresh = daqp.Model()
fresh.setup(H, f, A, sense=np.zeros(3, dtype=np.int32), **bounds(0.4))
seen.append(("fresh model, s = 0.4", solve(fresh)))
for what, value in seen:
    print(f"{what:24} {value}")
as_stated = [value for _, value in seen] == [
    ([0.75, 0.75], 1),
    (-1, [1.0, 1.0], 1),
    (0, [1.0, 1.0], 1),
    (0, [1.0, 1.0], 1),
    (0, [0.2, 0.2], 1),
    ([0.2, 0.2], 1),
]
sys.exit(0 if as_stated else 1)
PY
