"""From the parameters to the constants of the kernel: what is switched off is left out here."""

from __future__ import annotations

import math

from test_rig_sim import inner_loop
from test_rig_sim.contact import Contact
from test_rig_sim.drive import Drive
from test_rig_sim.force_observer import ForceObserver, force_observer
from test_rig_sim.load_cell import LoadCell, load_cell
from test_rig_sim.rig_parameters import RigParameters
from test_rig_sim.structure import Structure, structure


def drive_of(p: RigParameters) -> Drive:
    """Return the drive, without the friction and cogging that are switched off."""
    values = p.drive.model_dump(exclude={"current_limit", "current_slew", "delay"})
    if not p.imperfections.friction:
        values.update(coulomb_friction=0.0, static_friction=0.0, viscous_friction=0.0)
    if not p.imperfections.cogging:
        values.update(cogging_amplitude=0.0, cogging_second=0.0)
    return Drive(**values)


def amplifier_of(p: RigParameters) -> inner_loop.Amplifier:
    """Return limit, slew and delay of the motor current, infinite or 0 where switched off."""
    on = p.imperfections
    return inner_loop.Amplifier(
        p.drive.current_limit if on.current_limit else math.inf,
        p.drive.current_slew if on.current_slew else math.inf,
        p.drive.delay if on.delay else 0,
    )


def loop_of(p: RigParameters) -> inner_loop.InnerLoop:
    """Design the inner loop. Raises ValueError if it is not stable."""
    q = p.inner_loop
    resonances: tuple[inner_loop.Resonance, ...] = ()
    if q.frequency_weighting:
        rows = zip(q.filter_frequencies_hz, q.filter_damping_ratios, q.filter_weights, strict=True)
        resonances = tuple(inner_loop.Resonance(*row) for row in rows)
    return inner_loop.design(
        drive_of(p),
        inner_loop.Weights(q.position_weight, q.velocity_weight, q.current_weight),
        resonances,
        inner_loop.Noise(**p.observer.model_dump()),
        amplifier_of(p),
        period_of(p),
    )


def period_of(p: RigParameters) -> float:
    """Return the period of the inner loop in s."""
    return p.cycle_time / p.inner_steps


def structure_of(p: RigParameters, rest_force: float) -> Structure:
    """Return the supporting structure, rigid if switched off; rest_force in N is the stator's force at the start."""
    q = p.structure
    if not p.imperfections.structure:
        return structure((), (), (), rest_force)
    return structure(q.frequencies_hz, q.damping_ratios, q.modal_masses, rest_force)


def cell_of(p: RigParameters) -> LoadCell:
    """Return the load cell, sampled at the integration step."""
    on, q = p.imperfections, p.load_cell
    return load_cell(
        q.plate_mass * (1.0 - q.compensation) if on.load_cell_inertia else 0.0,
        q.bias if on.load_cell_bias else 0.0,
        q.bandwidth_hz if on.load_cell_dynamics else 0.0,
        q.damping,
        period_of(p) / p.substeps,
    )


def force_observer_of(p: RigParameters) -> ForceObserver:
    """Return the observer of the contact force; it makes up for the cell's lag only where the cell has dynamics."""
    q = p.force_observer
    return force_observer(
        q.bandwidth_hz, q.damping, q.cell_lag if p.imperfections.load_cell_dynamics else 0.0, period_of(p)
    )


def contact_of(p: RigParameters, touching: bool) -> Contact:
    """Return the contact; without touching, head and drive pass through each other."""
    return Contact(p.contact.stiffness, p.contact.damping) if touching else Contact(0.0, 0.0)


def noise_of(p: RigParameters) -> float:
    """Return the standard deviation of the load cell's noise in N."""
    return p.load_cell.noise if p.imperfections.load_cell_noise else 0.0


def resolution_of(p: RigParameters) -> float:
    """Return the encoder's step in m, 0 for none."""
    return p.encoder_resolution if p.imperfections.encoder else 0.0
