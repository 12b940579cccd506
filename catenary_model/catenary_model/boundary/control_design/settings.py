"""What a design of the controlled layer may choose."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Dispersion = Literal["discretised", "continuous"]


@dataclass(frozen=True)
class Settings:
    """Everything but wire, speed, mesh and time step. Raises ValueError naming the field."""

    dispersion: Dispersion
    """Which waves the harmonics are: those of the beam (3.26), or those of mesh and time step (3.27)."""
    input_nodes: int
    """Nodes, from the end inwards, on which forces and torques act (3.31)."""
    state_nodes: int
    """N_x, nodes, from the end inwards, whose state is fed back; at most the nodes of the layer."""
    horizon: int
    """n_p, steps over which the reference is tracked (3.38)."""
    moves: int
    """n_c, steps whose inputs are free; the last one is held to the end of the horizon (3.38)."""
    lowest: float
    """Lowest frequency of the harmonics, in the frame of the train, Hz."""
    highest: float
    """Highest frequency of the harmonics, Hz."""
    harmonics: int
    """N_Omega, frequencies, spaced evenly on a logarithmic scale."""
    regularisation: float
    """alpha of (3.32) per node and harmonic, m^2: displacement that the fit trades for amplitude, squared."""
    tilt: float
    """Weight of a harmonic is frequency^-tilt: 1 makes the same velocity of all harmonics equally dear."""
    above: float
    """Further weight of the harmonics above `band`: below 1 their amplitudes are dearer, the fit is theirs last."""
    others: float
    """Weight of waves that the layer leaves alone, and that the fit has to tell from its own: all that come in, and
    those that leave above `highest`. 0: they are not looked for."""
    velocity: float
    """Weight of q' in the fit, s: a velocity of 1 m/s counts like a displacement of this many metres."""
    decay: float
    """sigma_w at the very end, nepers (3.36); 0 leaves the reference undamped."""
    growth: float
    """Power with which sigma_w grows from 0 at the innermost input node."""
    effort: float
    """R_ABC over the mean of what an input does to the first term of (3.38): 0 is free, 1 halves an input."""
    band: float = 30.0
    """Frequencies up to here are what the layer is for, Hz."""

    def __post_init__(self) -> None:
        for name in ("input_nodes", "state_nodes", "horizon", "moves", "harmonics"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)} must be at least 1")
        for name in ("lowest", "highest", "regularisation", "above", "growth", "effort", "band"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} = {value} must be finite and above 0")
        for name in ("tilt", "others", "velocity", "decay"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} = {value} must be finite and at least 0")
        if self.dispersion not in ("discretised", "continuous"):
            raise ValueError(f"dispersion = {self.dispersion!r} is neither discretised nor continuous")
        if self.moves > self.horizon:
            raise ValueError(f"moves = {self.moves} exceeds horizon = {self.horizon}")
        if self.highest <= self.lowest:
            raise ValueError(f"highest = {self.highest} Hz must exceed lowest = {self.lowest} Hz")
        if self.input_nodes > self.state_nodes:
            raise ValueError(f"input_nodes = {self.input_nodes} exceeds state_nodes = {self.state_nodes}")
