#!/usr/bin/env bash
# clarabel 0.11.1: a strictly convex QP with one bound of 1e9 that never acts is reported DualInfeasible
#
# A strictly convex QP is bounded below, so its dual is feasible whatever the constraints are. With a bound between
# 1e9 and 1e19 on a variable whose optimum is 3, Clarabel ends with status DualInfeasible and x near 0: a certificate
# of something that cannot be. Up to 1e8, and from 1e20 on (which the presolve takes for infinite and removes), the
# same problem is Solved with x = 3. Without presolve 1e20 and infinity are DualInfeasible as well. Bounds of this
# size are what other solvers' "infinity" or an unused limit look like. The documentation says that the presolve
# removes bounds above its threshold (1e20), not that bounds below it spoil the status; the project's tracker advises
# infinity in place of 1e8 for another problem, which ended with InsufficientProgress.
#
#   minimise 1/2 x^2 - 3 x   subject to  -1 <= x <= b
#
# Seen:
#   b = 1e8                     Solved          x = 3
#   b = 1e9, 1e12, 1e19         DualInfeasible  x = 4e-7, 4e-10, 4e-17
#   b = 1e20 (presolve)         Solved          x = 3
#   b = 1e20 (no presolve)      DualInfeasible
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq clarabel==0.11.1 numpy==2.2.6 scipy==1.15.3 || exit 2
"$temp/venv/bin/python" - <<'PY'
import sys

import clarabel
import numpy as np
import scipy.sparse as sparse


def solve(b, presolve=True):
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.presolve_enable = presolve
    P, A = sparse.csc_matrix([[1.0]]), sparse.csc_matrix([[1.0], [-1.0]])
    cones = [clarabel.NonnegativeConeT(2)]
    solution = clarabel.DefaultSolver(P, np.array([-3.0]), A, np.array([b, 1.0]), cones, settings).solve()
    return str(solution.status), solution.x[0]


as_stated = True
for b, presolve, status in (
    (1e4, True, "Solved"),
    (1e8, True, "Solved"),
    (1e9, True, "DualInfeasible"),
    (1e12, True, "DualInfeasible"),
    (1e19, True, "DualInfeasible"),
    (1e20, True, "Solved"),
    (1e20, False, "DualInfeasible"),
):
    have, x = solve(b, presolve)
    print(f"b = {b:7.0e}  presolve {presolve!s:5}  {have:14}  x = {x:.6g}")
    as_stated &= have == status and abs(x - (3.0 if status == "Solved" else 0.0)) < 1e-5
sys.exit(0 if as_stated else 1)
PY
