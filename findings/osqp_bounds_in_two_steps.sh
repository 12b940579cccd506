#!/usr/bin/env bash
# osqp 1.1.3 (Python): bounds that move past each other in two updates are lost, and the solve says "solved"
#
# update(l=...) and update(u=...) may be called one after the other; the interface takes each alone. If the new lower
# bound lies above the old upper one, the first call prints "ERROR in osqp_update_data_vec: Problem data validation."
# and changes nothing, but raises nothing and returns None, as a call that worked. The second call is accepted, so
# that the problem has the old lower and the new upper bound, and solve() answers "solved" with a point far outside
# the window that was asked for. setup() raises OSQPException for the same data, and osqp 0.6 raised ValueError in
# update(): its Python code ignores the error code that the C library returns. A wrong number of values in Px or Ax
# is swallowed in the same way.
#
#   minimise 1/2 x^2   subject to  l <= x <= u;  first -1 <= x <= 1, then 3 <= x <= 4
#
# Seen:
#   update(l=3), update(u=4)   x = 0   "solved"          (no exception)
#   update(l=3, u=4)           x = 3   "solved"
#   update(Px=[1, 1])          x = 3   "solved"          (P has one entry; no exception)
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq osqp==1.1.3 numpy==2.2.6 scipy==1.15.3 || exit 2
"$temp/venv/bin/python" - <<'PY'
import sys

import numpy as np
import osqp
import scipy.sparse as sparse

ONE = sparse.csc_matrix([[1.0]])


def solver():
    problem = osqp.OSQP()
    settings = {"verbose": False, "eps_abs": 1e-8, "eps_rel": 1e-8}
    problem.setup(ONE, np.array([0.0]), ONE, np.array([-1.0]), np.array([1.0]), **settings)
    problem.solve()
    return problem


def answer(problem):
    result = problem.solve()
    return round(float(result.x[0]), 3), result.info.status


two = solver()
returned = (two.update(l=np.array([3.0])), two.update(u=np.array([4.0])))
two_steps = answer(two)
one = solver()
one.update(l=np.array([3.0]), u=np.array([4.0]))
one_step = answer(one)
wrong = one.update(Px=np.array([1.0, 1.0]))
wrong_count = answer(one)
print("update(l=3), update(u=4):", returned, two_steps)
print("update(l=3, u=4):        ", one_step)
print("update(Px=[1, 1]):       ", wrong, wrong_count)
as_stated = (
    returned == (None, None)
    and two_steps == (0.0, "solved")
    and one_step == (3.0, "solved")
    and wrong is None
    and wrong_count == (3.0, "solved")
)
sys.exit(0 if as_stated else 1)
PY
