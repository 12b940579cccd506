"""The compiled part of a cycle before its quadratic program: plan carried on, forecast, gradient, bounds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impedance_mpc import forecast
from impedance_mpc.condense import MILLIMETRE, Program
from impedance_mpc.plant import Array, RigModel
from impedance_mpc.predict import (
    CORRECTION,
    DRIFT,
    FORCE_NOW,
    MOMENTUM,
    POSITION_BIAS,
    REFERENCE,
    VELOCITY_BIAS,
)
from phil_base.held import Held
from phil_base.kernels import njit

# entries of Work.now, what a cycle is told
W_TR, V_TR, F_TR, WAY, W_ENV, V_ENV, F_ENV, F_ENV_BEFORE, OFFSET, DRIFT_NOW, DELTA_P, REFERENCE_NOW, F_COR = range(13)
NOW = 13
# entries of Constants.places: where parts of p begin, see `predict.Layout`; degrees of freedom of the wire, cycles of
# dead time, Nc
WIRE, RAMP, FORCE, MOMENTUM_PART, FREEDOMS, DEAD_TIME, MOVES = range(7)


class Constants(NamedTuple):
    """What the compiled part needs of the design."""

    gradient_t: Array
    row_free: Array
    row_columns: NDArray[np.int64]
    limit_lower: Array
    limit_upper: Array
    output: Array
    places: NDArray[np.int64]  # see WIRE, ...
    compliance: float
    ts: float
    rig_a: Array
    rig_tail: Array
    rig_head: Array


class Work(NamedTuple):
    """What it changes."""

    now: Array  # (NOW,), see W_TR, ...
    p: Array  # all that the cycle knows, see `predict.Layout`
    g: Array  # gradient (2 Nc,)
    lower: Array  # bounds of the rows (m,)
    upper: Array
    ramps: Array  # starts and ends of the commands before, newest first, m
    filter: Array  # (3,), state of the forecast
    way: Array  # (Np,), way of the drive in each coming cycle, m
    scratch: Array  # (5,)


def constants(made: Program, rig: RigModel, output: Array, compliance: float, ts: float, limits: Array) -> Constants:
    """Collect the constants; ``limits`` are those of position, velocity and lead, (2, 3), lower and upper, in mm."""
    layout = made.layout
    places = [layout.wire, layout.ramp, layout.force, layout.momentum, layout.n, rig.cycles, made.control_horizon]
    return Constants(
        made.gradient_t,
        made.row_free,
        made.row_columns,
        np.ascontiguousarray(limits[0][made.kind]),
        np.ascontiguousarray(limits[1][made.kind]),
        np.ascontiguousarray(output),
        np.array(places, dtype=np.int64),
        compliance,
        ts,
        rig.a.copy(),
        rig.tail.copy(),
        rig.head.copy(),
    )


def work(made: Program) -> Work:
    """Make the arrays that a cycle changes."""
    layout, m = made.layout, len(made.kind)
    return Work(
        np.zeros(NOW),
        np.zeros(layout.size),
        np.zeros(len(made.hessian)),
        np.zeros(m),
        np.zeros(m),
        np.zeros(2 * layout.ramps),
        np.zeros(3),
        np.zeros(layout.horizon),
        np.zeros(5),
    )


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def _ways(c: Constants, s: Work, plan: Array) -> None:
    """Carry the plan of the cycle before on by one cycle; write the drive's way in each coming cycle, m.

    plan (Nc,) in mm is still the one of the cycle before: its entry 1 is u_tr of this cycle.
    """
    n_c, cycles = c.places[MOVES], c.places[DEAD_TIME]
    w, v = s.now[W_TR], s.now[V_TR]
    tail = s.scratch[0:2]
    for i in range(s.way.size):
        old, new = i - cycles - 1, i - cycles
        for j in range(2):
            number = old if j == 0 else new
            if number < 0:
                at = -1 - number
                begin, end = s.ramps[2 * at], s.ramps[2 * at + 1]
            else:
                begin = plan[min(number + 1, n_c - 1)] * MILLIMETRE
                end = plan[min(number + 2, n_c - 1)] * MILLIMETRE
            if j == 0:
                tail[0], tail[1] = begin, end
        a = c.rig_a[0, 0] * w + c.rig_a[0, 1] * v
        b = c.rig_a[1, 0] * w + c.rig_a[1, 1] * v
        a += c.rig_tail[0, 0] * tail[0] + c.rig_tail[0, 1] * tail[1] + c.rig_head[0, 0] * begin + c.rig_head[0, 1] * end
        b += c.rig_tail[1, 0] * tail[0] + c.rig_tail[1, 1] * tail[1] + c.rig_head[1, 0] * begin + c.rig_head[1, 1] * end
        s.way[i] = a - w
        w, v = a, b


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def force_ahead(c: Constants, s: Work, d: forecast.Design, plan: Array) -> float:
    """Bring the forecast to t_k and predict the contact force over the horizon; return that of t_(k+1), N."""
    force = c.places[FORCE]
    forecast.observe(d, s.filter, s.now[F_TR], s.now[WAY])
    _ways(c, s, plan)
    forecast.forecast(d, s.filter, s.now[F_TR], s.way, s.p[force : force + s.way.size], s.scratch[2:5])
    return s.p[force]


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def prepare(c: Constants, s: Work, displacement: Array, velocity: Array, acceleration: Array, held: Array) -> None:
    """Fill p with all that is known at t_k and compute gradient g = G p and the bounds of the rows.

    The gradient goes column by column of G, so that the inner loop runs over contiguous memory.
    """
    wire, ramp, momentum, n = c.places[WIRE], c.places[RAMP], c.places[MOMENTUM_PART], c.places[FREEDOMS]
    p, now = s.p, s.now
    p[0], p[1] = now[W_TR], now[V_TR]
    model_w, model_v = 0.0, 0.0
    for i in range(n):
        p[wire + i] = displacement[i]
        p[wire + n + i] = velocity[i]
        p[wire + 2 * n + i] = acceleration[i]
        p[wire + 3 * n + i] = held[i]
        model_w += c.output[i] * displacement[i]
        model_v += c.output[i] * velocity[i]
    for i in range(s.ramps.size):
        p[ramp + i] = s.ramps[i]
    p[momentum + MOMENTUM] = now[DELTA_P]
    p[momentum + FORCE_NOW] = now[F_ENV]
    p[momentum + POSITION_BIAS] = now[W_ENV] - model_w - c.compliance * now[F_ENV] + now[OFFSET]
    p[momentum + VELOCITY_BIAS] = now[V_ENV] - model_v - c.compliance * (now[F_ENV] - now[F_ENV_BEFORE]) / c.ts
    p[momentum + DRIFT] = now[DRIFT_NOW]
    p[momentum + REFERENCE] = now[REFERENCE_NOW]
    p[momentum + CORRECTION] = now[F_COR]
    moves = c.gradient_t.shape[1]
    for i in range(moves):
        s.g[i] = 0.0
    for j in range(p.size):
        factor = p[j]
        for i in range(moves):
            s.g[i] += c.gradient_t[j, i] * factor
    for i in range(s.lower.size):
        free = 0.0
        for j in range(c.row_columns.size):
            free += c.row_free[i, j] * p[c.row_columns[j]]
        s.lower[i] = c.limit_lower[i] - free
        s.upper[i] = c.limit_upper[i] - free


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def force_ahead_held(
    held: Held, fresh: bool, w_tr: float, v_tr: float, f_tr: float, reference: float, w: float, v: float, f: float
) -> float:
    """Note both states at t_k (m, m/s, N), then call `force_ahead` with what is held.

    Held are constants and forecast, work and plan. ``reference`` (m) is the end of the last ramp that the rig accepted,
    NaN: as it was commanded; in a ``fresh`` ride there was none.
    """
    s, plan = held.state[0], held.state[1]
    now, ramps = s.now, s.ramps
    if not fresh:
        sent, begun, stood = plan[1] * MILLIMETRE, plan[0] * MILLIMETRE, ramps[1]
        if np.isnan(reference):
            reference = sent
        for i in range(ramps.size - 1, 1, -1):
            ramps[i] = ramps[i - 2]
        # A command that the rig did not take (too late, or not wanted) left it on a ramp from where it was.
        ramps[0] = begun if abs(reference - sent) < 1e-9 else stood
        ramps[1] = reference
    now[WAY] = w_tr - now[W_TR]
    now[W_TR], now[V_TR], now[F_TR] = w_tr, v_tr, f_tr
    before = now[F_ENV]
    now[F_ENV_BEFORE] = f if np.isnan(before) else before
    now[W_ENV], now[V_ENV], now[F_ENV] = w, v, f
    now[REFERENCE_NOW] = reference
    return force_ahead(held.constants[0], s, held.constants[1], plan)


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def prepare_held(held: Held, displacement: Array, velocity: Array, acceleration: Array, force: Array) -> None:
    """Call `prepare` with what is held; ``force`` is f_held."""
    prepare(held.constants[0], held.state[0], displacement, velocity, acceleration, force)
