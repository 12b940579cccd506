"""Environments that the controller simulates itself: linear models that can take over from another one at any instant.

Where the catenary's state arrives with every cycle, these are integrated here, by the same Newmark step (3.19) to
(3.23) that the controller predicts with; the catenary's own: see ``catenary_model/wires.py``.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from impedance_mpc.controller import EnvironmentReading
from impedance_mpc.environment_parameters import MassSpringDamper, ReducedEnvironment
from impedance_mpc.plant import Impedance, newmark_state_space
from phil_base import newmark


class Environment(Protocol):
    """What the switch asks of an environment that is simulated here."""

    model: Impedance

    def begin(self, old: EnvironmentReading, mean_force: float, segment: EnvironmentReading) -> None:
        """Take over from another environment at t_k."""

    def reading(self) -> EnvironmentReading:
        """Show the present instant."""

    def step(self, force: float) -> None:
        """Go from t_k to t_(k+1); the force (N) goes there in a straight line."""


def mass_spring_damper(p: MassSpringDamper, ts: float) -> Impedance:
    """Return m w'' + d w' + k w = f_held + f with step ts (s). Raises ValueError without a spring."""
    if p.stiffness <= 0.0:
        raise ValueError(
            f"parameter 'environments.mass_spring_damper.stiffness' = {p.stiffness:g} N/m has to be above 0: singular, "
            "without a spring nothing bears the mean contact force"
        )
    one = np.ones(1)
    return Impedance(
        mass=np.array([[p.mass]]),
        damping=np.array([[p.damping]]),
        stiffness=np.array([[p.stiffness]]),
        input=one,
        output=one.copy(),
        ts=ts,
    )


def standing_alone(model: Impedance, p: ReducedEnvironment) -> Impedance:
    """Return the reduced model with a spring and a damper along the segment, which by itself would drift away.

    Both go with the mass, K + omega^2 M and D + 2 zeta omega M, as a foundation does that carries the wire evenly: so
    no part of the segment is left without, and its waves keep their shape. The wire's local compliance, which is no
    part of the mesh, is left out.

    Raises
    ------
    ValueError
        The model with its spring is not stable.
    """
    omega = 2.0 * math.pi * p.frequency_hz
    found = Impedance(
        mass=model.mass,
        damping=model.damping + 2.0 * p.damping_ratio * omega * model.mass,
        stiffness=model.stiffness + omega**2 * model.mass,
        input=model.input,
        output=model.output,
        ts=model.ts,
        newmark_beta=model.newmark_beta,
        newmark_gamma=model.newmark_gamma,
    )
    radius = float(np.abs(np.linalg.eigvals(newmark_state_space(found).a)).max())
    if not radius < 1.0:
        raise ValueError(
            f"environments.reduced: the reduced model on its own is not stable (spectral radius {radius:.6f}): "
            "raise environments.reduced.frequency_hz or damping_ratio"
        )
    return found


class LinearEnvironment:
    """M q'' + D q' + K q = f_held + b f, contact point c q, under a force that is told step by step.

    f_held is constant: with it the model stands, under the mean contact force, where it is taken over.

    Raises
    ------
    ValueError
        The mass matrix, the stiffness matrix or the Newmark step is singular.
    """

    def __init__(self, model: Impedance) -> None:
        self.model = model
        n, step = model.n, (model.ts, model.newmark_beta, model.newmark_gamma)
        try:
            k_dm = np.linalg.inv(newmark.step_matrix(model.mass, model.damping, model.stiffness, *step))
            shape = np.linalg.solve(model.stiffness, model.input)
            self._inverse_mass = np.linalg.inv(model.mass)
        except np.linalg.LinAlgError:
            raise ValueError("environment: mass, stiffness or Newmark matrix is singular") from None
        # q'' = response [q; q'] + f_held part + b part, q and q' the predictors of (3.19, 3.20)
        self._response = np.ascontiguousarray(-k_dm @ np.hstack([model.stiffness, model.damping]))
        self._held_response = k_dm
        self._input_response = k_dm @ model.input
        # The static deflection under the contact point, 1 there.
        self._shape = shape / float(model.output @ shape)
        self._q, self._qd, self._qdd = np.zeros(n), np.zeros(n), np.zeros(n)
        self._held, self._held_acceleration = np.zeros(n), np.zeros(n)
        self._predicted, self._scratch = np.zeros(2 * n), np.zeros(n)
        self._force = self._work = self._impulse = self._w = 0.0

    def begin(self, old: EnvironmentReading, mean_force: float, segment: EnvironmentReading) -> None:
        """Start at t_k where ``old`` is, with its position, velocity and force; work and impulse are zero.

        ``segment`` is the catenary at t_k: if the model is one of its segment, it begins in the segment's shape,
        shifted along the static deflection to where ``old`` is. ``mean_force`` in N is the one under which it rests.
        """
        model, n = self.model, self.model.n
        q, qd = self._q, self._qd
        if segment.displacement.size == n:
            q[:], qd[:] = segment.displacement, segment.velocity
        else:
            q[:] = qd[:] = 0.0
        q += (old.w - float(model.output @ q)) * self._shape
        qd += (old.v - float(model.output @ qd)) * self._shape
        self._held[:] = model.stiffness @ q - mean_force * model.input
        self._held_acceleration[:] = self._held_response @ self._held
        # M q'' = f_held + b f - D q' - K q
        self._qdd[:] = self._inverse_mass @ ((old.f - mean_force) * model.input - model.damping @ qd)
        self._w, self._force = old.w, old.f
        self._work = self._impulse = 0.0

    def reading(self) -> EnvironmentReading:
        """Show q, q', q'', f_held (views that the next step changes), contact point, force, work and impulse at t_k."""
        v = float(self.model.output.dot(self._qd))
        return EnvironmentReading(
            self._q, self._qd, self._qdd, self._held, self._w, v, self._force, self._work, self._impulse
        )

    def step(self, force: float) -> None:
        """One Newmark step, in place (3.19 to 3.23, see `phil_base.newmark`); work and impulse are trapezoids of it."""
        model, n, dt = self.model, self.model.n, self.model.ts
        beta, gamma = model.newmark_beta, model.newmark_gamma
        q, qd, qdd, new = self._q, self._qd, self._qdd, self._scratch
        new[:] = qdd
        new *= 0.5 - beta
        new *= dt
        new += qd
        new *= dt
        q += new
        new[:] = qdd
        new *= dt * (1.0 - gamma)
        qd += new
        self._predicted[:n], self._predicted[n:] = q, qd
        np.dot(self._response, self._predicted, out=qdd)
        qdd += self._held_acceleration
        new[:] = self._input_response
        new *= force
        qdd += new
        new[:] = qdd
        new *= beta * dt**2
        q += new
        new[:] = qdd
        new *= gamma * dt
        qd += new
        w = float(model.output.dot(q))
        mean = 0.5 * (self._force + force)
        self._work += mean * (w - self._w)
        self._impulse += mean * dt
        self._w, self._force = w, force
