"""From wire, speed, mesh and time step to the gains of both ends, (3.30) to (3.39) in order."""

from __future__ import annotations

import math
from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary.control_design import cache
from catenary_model.boundary.control_design.dispersion import travelling
from catenary_model.boundary.control_design.horizon import first_move, forced_response, free_response
from catenary_model.boundary.control_design.modal import cosines_and_sines, modal_gain
from catenary_model.boundary.control_design.reference import damping_profile, trajectory
from catenary_model.boundary.control_design.segment import segment
from catenary_model.boundary.control_design.settings import Settings
from catenary_model.boundary.layer import AHEAD, BEHIND, Feedback, Layer
from catenary_model.boundary.matched_dashpot import matched_dashpot
from catenary_model.boundary.stability import spectral_radius
from catenary_model.line import Wire
from catenary_model.moving_frame import CONTACT, Mesh, assemble

Array = NDArray[np.float64]

OTHERS = 20
"""Frequencies above those of the harmonics that are looked for to be left alone."""
CAUTION = (1.0, 10.0, 100.0)
"""Factors on the weight of `others` that are tried in turn until a design is stable."""
SPACE = 20
"""Nodes between the two layers of the closed loop whose spectral radius is checked; a shorter domain is the harder."""


def end_gain(wire: Wire, h: float, speed: float, end: int, step: Layer, settings: Settings) -> Array:
    """Return K_ABC (3.39) of one end, (2 input nodes, 6 state nodes), not yet checked for stability.

    What the harmonics do not explain of x is left to the plant: its error in (3.38) is taken as nil. So the layer
    leaves waves alone that come in, as far as they do not look like ones that go out.
    """
    seen = settings.state_nodes
    beyond = 8 + math.ceil(settings.horizon * step.ts * (wire.wave_speed + speed) / h)
    plant = segment(wire, h, speed, end, seen + beyond, step)
    frequency = np.geomspace(settings.lowest, min(settings.highest, 0.45 / step.ts), settings.harmonics)
    where = (settings.dispersion, wire, h, speed, end, plant.nodes)
    harmonics = travelling(*where, frequency, step)
    profile = damping_profile(plant.nodes, settings.input_nodes, settings.decay, settings.growth)

    # the field that is fitted is the one that an ideal layer leaves: damped by the profile
    state = cosines_and_sines(np.tile(profile, 3)[:, None] * harmonics.state)
    rows = (2 * plant.nodes * np.arange(2)[:, None] + np.arange(2 * seen)).ravel()
    in_metres = np.tile((1.0, h), seen)
    row_weight = np.concatenate((in_metres, settings.velocity * in_metres))
    falling = frequency**-settings.tilt * np.where(frequency <= settings.band, 1.0, settings.above)
    amplitude_weight = np.tile(falling, 2)
    fitted = state[rows]
    if settings.others > 0.0:
        higher = np.geomspace(frequency[-1], 0.49 / step.ts, OTHERS + 1)[1:]
        coming = travelling(*where, np.concatenate((frequency, higher)), step, leave=False)
        leaving = travelling(*where, higher, step)
        fitted = np.hstack((fitted, *(cosines_and_sines(wave.state)[rows] for wave in (coming, leaving))))
        weights = (amplitude_weight[: frequency.size], np.full(OTHERS, amplitude_weight[frequency.size - 1]))
        both = np.concatenate((np.tile(np.concatenate(weights), 2), np.tile(weights[1], 2)))
        amplitude_weight = np.concatenate((amplitude_weight, settings.others * both))
    K_mod = modal_gain(fitted, row_weight, amplitude_weight, settings.regularisation * seen)[: state.shape[1]]

    reference = trajectory(harmonics, profile, settings.horizon)[:, : 2 * seen]
    error = reference - free_response(plant, 2 * seen, settings.horizon, state)
    G = forced_response(plant, 2 * seen, 2 * settings.input_nodes, settings.horizon, settings.moves)
    input_weight = np.tile((1.0, 1.0 / h), settings.input_nodes)
    u = first_move(G, error.reshape(G.shape[0], -1), in_metres, input_weight, settings.effort)
    return np.hstack((u @ K_mod, np.zeros((2 * settings.input_nodes, 2 * seen))))


def wire_gains(wire: Wire, h: float, speed: float, layer: Layer, settings: Settings) -> tuple[Array, Array]:
    """Return K_ABC of the end behind and of the end ahead, from the cache if they have been designed before.

    If a wire between two such ends is not stable, more of the field is taken for waves that are to be left alone, in
    the steps of CAUTION: less is absorbed, and less is stirred up. Raises ValueError with the spectral radius if that
    does not help.
    """
    count = min(settings.state_nodes, layer.nodes)
    if count < 1:
        raise ValueError("nodes = 0: a controlled layer needs at least one node")
    fitting = replace(settings, state_nodes=count, input_nodes=min(settings.input_nodes, count))

    def design() -> dict[str, Array]:
        for caution in CAUTION:
            careful = replace(fitting, others=caution * fitting.others)
            behind, ahead = (end_gain(wire, h, speed, end, layer, careful) for end in (BEHIND, AHEAD))
            try:
                check(wire, h, speed, layer, (behind, ahead))
            except ValueError:
                if caution == CAUTION[-1]:
                    raise
            else:
                break
        return {"behind": behind, "ahead": ahead}

    step = {"ts": layer.ts, "beta": layer.beta, "gamma": layer.gamma}
    kind = {key: value for key, value in asdict(wire).items() if key not in ("source", "stiffness_damping")}
    stored = cache.cached("gain", {**kind, "h": h, "speed": speed, **step, **asdict(fitting)}, design)
    return stored["behind"], stored["ahead"]


def check(wire: Wire, h: float, speed: float, layer: Layer, gains: tuple[Array, ...]) -> float:
    """Return the spectral radius of a wire with these gains at its ends; raises ValueError unless it is below 1."""
    half = max(gain.shape[1] // 6 for gain in gains) + SPACE // 2
    frame = assemble(Mesh(h, half), wire, wire, speed)
    matched_dashpot(frame, layer)
    feedback = Feedback(((gains[BEHIND], gains[AHEAD]),) * 2)
    radius = spectral_radius(frame, feedback, layer, wires=(CONTACT,))
    if not radius < 1.0:
        plain = spectral_radius(frame, None, layer, wires=(CONTACT,))
        raise ValueError(
            f"controlled layer refused: spectral radius {radius:.6f} of the closed loop at {speed * 3.6:.1f} km/h, "
            f"dx {h} m, Ts {layer.ts} s; {plain:.6f} with plain dashpots"
        )
    return radius
