#!/usr/bin/env bash
# piqp 0.7.0: a row that was once open on both sides is never closed again by an update of its bounds
#
# Rows of G with infinite bounds on both sides are allowed; PIQP prints that it sets "the corresponding rows in G to
# zero (sparsity structure preserving)". The documentation of update() excludes only changes of dimension and of the
# sparsity pattern. But the row stays zero: update(h_l, h_u) with finite bounds is accepted, solve() says PIQP_SOLVED
# and the answer breaks the row by any amount, until G itself is handed over again. Bounds on variables (x_l, x_u)
# that open and close do work. A constraint that is inactive at first (a limit that comes into force later in the
# horizon, say) is the usual way into this. With the sparse solver, opening the row in an update (not in setup) does
# not end in PIQP_SOLVED at all.
#
#   minimise 1/2 |x|^2 - 3 x0 - 3 x1   subject to  -1 <= x0 <= 1,  l <= x1 <= u   (rows of G)
#
# Seen (both solvers, except the last line):
#   setup  x1 open                   PIQP_SOLVED  x = [1. 3.]
#   update -1 <= x1 <= 1             PIQP_SOLVED  x = [1. 3.]   x1 = 3, allowed 1
#   the same bounds and G            PIQP_SOLVED  x = [1. 1.]
#   update x1 open, then closed      PIQP_SOLVED  x = [1. 3.] (dense); PIQP_MAX_ITER_REACHED (sparse)
#   the same with x_l, x_u           PIQP_SOLVED  x = [1. 1.]
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq piqp==0.7.0 numpy==2.2.6 scipy==1.15.3 || exit 2
"$temp/venv/bin/python" - <<'PY'
import sys

import numpy as np
import piqp
import scipy.sparse as sparse

P, c, G, inf = np.eye(2), np.array([-3.0, -3.0]), np.eye(2), np.inf
OPEN = {"h_l": np.array([-1.0, -inf]), "h_u": np.array([1.0, inf])}
CLOSED = {"h_l": np.array([-1.0, -1.0]), "h_u": np.array([1.0, 1.0])}


def box(rows):
    return {"x_l": rows["h_l"], "x_u": rows["h_u"]}


def solve(solver):
    status = solver.solve().name
    return (status, solver.result.x.round(5).tolist()) if status == "PIQP_SOLVED" else (status,)


as_stated = True
solved = "PIQP_SOLVED"
for make, matrix in ((piqp.DenseSolver, np.asarray), (piqp.SparseSolver, sparse.csc_matrix)):
    solver = make()
    solver.setup(matrix(P), c, G=matrix(G), **OPEN)
    seen = [("row open in setup", solve(solver))]
    for what, update in (
        ("closed", CLOSED),
        ("closed, G handed over", {"G": matrix(G), **CLOSED}),
        ("opened in update", OPEN),
        ("closed", CLOSED),
    ):
        solver.update(**update)
        seen.append((what, solve(solver)))
    solver = make()
    solver.setup(matrix(P), c, **box(OPEN))
    solver.solve()
    solver.update(**box(CLOSED))
    seen.append(("x_l, x_u: open, closed", solve(solver)))
    for what, value in seen:
        print(f"{make.__name__:13} {what:24} {value}")
    last = (solved, [1.0, 3.0]) if make is piqp.DenseSolver else ("PIQP_MAX_ITER_REACHED",)
    as_stated &= [value for _, value in seen] == [
        (solved, [1.0, 3.0]),
        (solved, [1.0, 3.0]),
        (solved, [1.0, 1.0]),
        last,
        last,
        (solved, [1.0, 1.0]),
    ]
sys.exit(0 if as_stated else 1)
PY
