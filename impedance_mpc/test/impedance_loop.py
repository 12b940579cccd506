"""Closed loop for tests, in numpy only: ideal PT2 rig under a three-mass pantograph against two simple environments."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from impedance_mpc.controller import Command, EnvironmentReading, ImpedanceController, RigReading
from impedance_mpc.plant import Impedance, pt2_rig

Array = NDArray[np.float64]

TS = 0.002
INNER = 10


class Environment(Protocol):
    """What the loop needs of an environment."""

    impedance: Impedance
    w: float
    v: float
    force: float

    def segment(self) -> tuple[Array, Array, Array, Array]:
        """q, q', q'', f_held of the reduced model."""

    def step(self, force: float) -> None:
        """Go from t_k to t_(k+1) under a constant force."""


class MassSpringDamper:
    """One mass on a spring and a damper; the reduced model is exact, n = 1, so f_held is zero."""

    def __init__(self, mass: float = 15.0, damping: float = 200.0, stiffness: float = 5000.0) -> None:
        one = np.ones(1)
        self.impedance = Impedance(
            np.array([[mass]]), np.array([[damping]]), np.array([[stiffness]]), one, one, TS, 0.25, 0.5
        )
        self.x = np.zeros(3)
        self.force = 0.0

    @property
    def w(self) -> float:
        """Displacement in m."""
        return float(self.x[0])

    @property
    def v(self) -> float:
        """Velocity in m/s."""
        return float(self.x[1])

    def segment(self) -> tuple[Array, Array, Array, Array]:
        """Give q, q', q'', f_held."""
        return self.x[:1], self.x[1:2], self.x[2:], np.zeros(1)

    def step(self, force: float) -> None:
        """One Newmark step written out for one mass."""
        m, d, k = (float(a[0, 0]) for a in (self.impedance.mass, self.impedance.damping, self.impedance.stiffness))
        q, v, a = self.x
        q_free, v_free = q + TS * v + TS**2 * 0.25 * a, v + TS * 0.5 * a
        new = (force - d * v_free - k * q_free) / (m + 0.5 * TS * d + 0.25 * TS**2 * k)
        self.x[:] = q_free + TS**2 * 0.25 * new, v_free + TS * 0.5 * new, new
        self.force = force


class MovingString:
    """Tensioned string in the moving frame on springs that run through its mesh; the segment knows no spring.

    Linear elements of 0.8 m over +-60 m, matched dashpots at the ends, T = 20 kN, rhoA = 1.35 kg/m. The springs (one
    each 6 m, mean 400 N/m, varying +-50 % over a span of 60 m) stand for droppers and carrier.
    """

    def __init__(
        self,
        speed: float = 250.0 / 3.6,
        half: int = 75,
        segment: int = 25,
        spring: float = 400.0,
        h: float = 0.8,
    ) -> None:
        tension, density, damping = 20e3, 1.35, 0.2
        n = 2 * half + 1
        self.h, self.half, self.speed, self.spring, self.time = h, half, speed, spring, 0.0
        self.x = h * (np.arange(n) - half)
        mass, advection, laplace = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
        for e in range(n - 1):
            i = slice(e, e + 2)
            mass[i, i] += h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
            advection[i, i] += 0.5 * np.array([[-1.0, 1.0], [-1.0, 1.0]])
            laplace[i, i] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / h
        self.mass = density * mass
        self.damping = damping * mass - 2.0 * speed * density * advection
        self.stiffness = (tension - density * speed**2) * laplace - damping * speed * advection
        # Natural ends carry the flux of the v terms; a small dashpot of the string's impedance is enough for a test.
        wave = math.sqrt(tension / density)
        self.damping[0, 0] += density * (wave - speed) + speed * density
        self.damping[-1, -1] += density * (wave + speed) - speed * density
        self.q, self.qd, self.qdd = np.zeros(n), np.zeros(n), np.zeros(n)
        cut = self.cut = slice(half - segment, half + segment + 1)
        b = np.zeros(2 * segment + 1)
        b[segment] = 1.0
        self.impedance = Impedance(
            self.mass[cut, cut].copy(),
            self.damping[cut, cut].copy(),
            self.stiffness[cut, cut].copy(),
            b,
            b,
            TS,
            0.28,
            0.55,
        )
        self.force = 0.0

    def _springs(self) -> Array:
        added = np.zeros_like(self.mass)
        reach = self.h * self.half
        first = math.ceil((self.speed * self.time - reach) / 6.0)
        last = math.floor((self.speed * self.time + reach) / 6.0)
        for j in range(first, last + 1):
            zeta = 6.0 * j
            at = zeta - self.speed * self.time
            k = self.spring * (1.0 + 0.5 * math.cos(2.0 * math.pi * zeta / 60.0)) * min(1.0, (reach - abs(at)) / 20.0)
            e = min(int((at + reach) / self.h), 2 * self.half - 1)
            s = (at + reach) / self.h - e
            shape = np.array([1.0 - s, s])
            added[e : e + 2, e : e + 2] += k * np.outer(shape, shape)
        return added

    @property
    def w(self) -> float:
        """Displacement of the contact point in m."""
        return float(self.q[self.half])

    @property
    def v(self) -> float:
        """Velocity of the contact point in m/s."""
        return float(self.qd[self.half])

    def segment(self) -> tuple[Array, Array, Array, Array]:
        """Give q, q', q'' and the force of everything that the reduced model leaves out."""
        c, model = self.cut, self.impedance
        q, qd, qdd = self.q[c], self.qd[c], self.qdd[c]
        held = model.mass @ qdd + model.damping @ qd + model.stiffness @ q - model.input * self.force
        return q, qd, qdd, held

    def step(self, force: float) -> None:
        """One Newmark step of the full string."""
        beta, gamma = self.impedance.newmark_beta, self.impedance.newmark_gamma
        self.time += TS
        stiffness = self.stiffness + self._springs()
        q = self.q + TS * self.qd + TS**2 * (0.5 - beta) * self.qdd
        qd = self.qd + TS * (1.0 - gamma) * self.qdd
        right = -(self.damping @ qd) - stiffness @ q
        right[self.half] += force
        self.qdd = np.linalg.solve(self.mass + gamma * TS * self.damping + beta * TS**2 * stiffness, right)
        self.q = q + beta * TS**2 * self.qdd
        self.qd = qd + gamma * TS * self.qdd
        self.force = force


class Rig:
    """PT2 drive and three-mass pantograph, ten inner steps a cycle; the static force comes in softly over 1 s."""

    def __init__(
        self, frequency: float, damping: float, noise: float, low_pass: float, seed: int, contact: float
    ) -> None:
        dt = TS / INNER
        self.drive = pt2_rig(frequency, damping, dt)
        masses, stiffness, dampers = (6.0, 9.0, 7.5), (160.0, 15500.0, 7000.0), (100.0, 20.0, 20.0)
        k, d = np.zeros((3, 3)), np.zeros((3, 3))
        for matrix, values in ((k, stiffness), (d, dampers)):
            matrix[0, 0] += values[0]
            for i in (1, 2):
                matrix[i - 1 : i + 1, i - 1 : i + 1] += values[i] * np.array([[1.0, -1.0], [-1.0, 1.0]])
        inverse = np.diag(1.0 / np.array(masses))
        generator = np.zeros((8, 8))
        generator[:3, 3:6] = np.eye(3)
        generator[3:6, :3], generator[3:6, 3:6] = -inverse @ k, -inverse @ d
        generator[3, 6] = inverse[0, 0]  # static force on the frame
        generator[5, 7] = -inverse[2, 2]  # contact force on the head
        step = expm(generator * dt)
        self.a, self.b = step[:6, :6].copy(), step[:6, 6:].copy()
        self.panto, self.x, self.dt = np.zeros(6), np.zeros(2), dt
        self.static, self.contact, self.time = 150.0, contact, 0.0
        self.noise, self.random = noise, np.random.default_rng(seed)
        self.pole = math.exp(-2.0 * math.pi * low_pass * dt)
        self.filtered, self.work, self.impulse = 0.0, 0.0, 0.0

    def step(self, u: float, u_next: float) -> float:
        """Go from t_k to t_(k+1); give the measured contact force there."""
        for i in range(INNER):
            force = max(0.0, self.contact * (self.panto[2] - self.x[0]))
            static = self.static * min(1.0, 0.1 + 0.9 * self.time)
            self.panto = self.a @ self.panto + self.b @ np.array([static, force])
            r0, r1 = u + (u_next - u) * i / INNER, u + (u_next - u) * (i + 1) / INNER
            self.work += self.dt * force * float(self.x[1])
            self.impulse += self.dt * force
            self.x = self.drive.a @ self.x + self.drive.b0 * r0 + self.drive.b1 * r1
            self.time += self.dt
            force = max(0.0, self.contact * (self.panto[2] - self.x[0]))
            self.filtered += (1.0 - self.pole) * (force - self.filtered)
        return self.filtered + self.noise * float(self.random.standard_normal())


def random_impedance(n: int, seed: int = 0, compliance: float = 0.0) -> Impedance:
    """A model without any structure that could hide a mistake."""
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(n, n))
    return Impedance(
        mass=half @ half.T + n * np.eye(n),
        damping=10.0 * rng.normal(size=(n, n)) + 60.0 * np.eye(n),
        stiffness=2e3 * (half @ half.T + n * np.eye(n)) + 100.0 * rng.normal(size=(n, n)),
        input=rng.normal(size=n),
        output=rng.normal(size=n),
        ts=TS,
        newmark_beta=0.255,
        newmark_gamma=0.525,
        compliance=compliance,
    )


@dataclass
class Ride:
    """Record of a ride, one row a cycle."""

    w_tr: Array
    w_cat: Array
    v_tr: Array
    v_cat: Array
    f_tr: Array
    f_cor: Array
    delta_e: Array
    delta_p: Array
    u_tr: Array
    delta_work: Array
    exchanged: float
    status: list[int] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)

    def summary(self, skip: int = 500) -> dict[str, float]:
        """Figures after ``skip`` cycles; dE in percent of the energy exchanged."""
        e = (self.w_tr - self.w_cat)[skip:] * 1e3
        ev = (self.v_tr - self.v_cat)[skip:] * 1e3
        return {
            "pos_mm": float(np.sqrt(np.mean(e**2))),
            "vel_mm_s": float(np.sqrt(np.mean(ev**2))),
            "dE_end_%": 100.0 * abs(float(self.delta_e[-1])) / self.exchanged,
            "dE_rms_%": 100.0 * float(np.sqrt(np.mean(self.delta_e[skip:] ** 2))) / self.exchanged,
            "dW_end_%": 100.0 * abs(float(self.delta_work[-1])) / self.exchanged,
            "dW_rms_%": 100.0 * float(np.sqrt(np.mean(self.delta_work[skip:] ** 2))) / self.exchanged,
            "exch_J": self.exchanged,
            "dp_max": float(np.abs(self.delta_p).max()),
            "Fcor_rms": float(np.sqrt(np.mean(self.f_cor**2))),
            "F_mean": float(self.f_tr[skip:].mean()),
            "F_sigma": float(self.f_tr[skip:].std()),
            "fallbacks": float(sum(s == 2 for s in self.status)),
            "iter": float(np.mean(self.iterations)),
        }


def ride(
    controller: ImpedanceController,
    environment: Environment,
    cycles: int,
    frequency: float = 40.0,
    damping: float = 0.8,
    noise: float = 0.0,
    low_pass: float = 400.0,
    seed: int = 1,
    contact: float = 30e3,
) -> Ride:
    """Run the loop rig -> controller -> rig with the environment beside it."""
    rig = Rig(frequency, damping, noise, low_pass, seed, contact)
    log = np.zeros((cycles, 10))
    f_tr = work = impulse = 0.0
    record = Ride(*log.T, exchanged=0.0)
    for k in range(cycles):
        w_tr, v_tr = float(rig.x[0]), float(rig.x[1])
        w_cat, v_cat = environment.w, environment.v
        out: Command = controller.command(
            RigReading(w_tr, v_tr, f_tr, math.nan, rig.work, rig.impulse),
            EnvironmentReading(*environment.segment(), w_cat, v_cat, environment.force, work, impulse),
        )
        books = controller.books
        log[k] = w_tr, w_cat, v_tr, v_cat, f_tr, out.f_cor, books.delta_e, books.delta_p, out.u_tr, books.delta_work
        record.status.append(out.status)
        record.iterations.append(out.iterations)
        before, w_before = environment.force, environment.w
        environment.step(out.f_cat)
        work += 0.5 * (before + out.f_cat) * (environment.w - w_before)
        impulse += 0.5 * TS * (before + out.f_cat)
        f_tr = rig.step(out.u_tr, out.u_tr_next)
    record.exchanged = controller.books.exchanged_energy
    return record
