"""Absorbing boundaries for linear wave-like PDEs by optimisation of finite-difference stencils (thesis 3.1.5).

A PDE of your own, and a boundary for it that reflects little and is stable:

    from catenary_model import absorbing
    from catenary_model.absorbing import Term

    scheme = absorbing.from_terms([Term(1.0, time=2), Term(-(50.0**2), space=(2,)), Term(9.0)], dx=0.5, dt=0.005)
    made = absorbing.design(scheme, "left", n_x=3, n_t=3, weighting=absorbing.band(2.0, 12.0))
    echo = absorbing.reflection(scheme, made.boundary, made.weighting.inside())
    frames = absorbing.run(scheme, made.boundary, None, start, count=1000)
"""

from catenary_model.absorbing.boundary import BoundaryStencil, clamped, read_file, unknowns, write_file
from catenary_model.absorbing.cache import cached_design, cached_pair
from catenary_model.absorbing.design import Demands, Design, Sweep, design, design_pair, read_design
from catenary_model.absorbing.dispersion import growth, spatial_roots, temporal_roots, waves
from catenary_model.absorbing.equations import beam, wave_1d, wave_2d
from catenary_model.absorbing.measure import broadband, packet
from catenary_model.absorbing.moving_beam import moving_beam
from catenary_model.absorbing.objective import J_OE, output_error
from catenary_model.absorbing.refine import Settings, refine
from catenary_model.absorbing.reflection import reflection
from catenary_model.absorbing.simulate import run, steps
from catenary_model.absorbing.stability import eigenvalues, radius
from catenary_model.absorbing.stencil import Stencil, Term, centred, difference, from_terms
from catenary_model.absorbing.weighting import Weighting, band

__all__ = [
    "J_OE",
    "BoundaryStencil",
    "Demands",
    "Design",
    "Settings",
    "Stencil",
    "Sweep",
    "Term",
    "Weighting",
    "band",
    "beam",
    "broadband",
    "cached_design",
    "cached_pair",
    "centred",
    "clamped",
    "design",
    "design_pair",
    "difference",
    "eigenvalues",
    "from_terms",
    "growth",
    "moving_beam",
    "output_error",
    "packet",
    "radius",
    "read_design",
    "read_file",
    "refine",
    "reflection",
    "run",
    "spatial_roots",
    "steps",
    "temporal_roots",
    "unknowns",
    "wave_1d",
    "wave_2d",
    "waves",
    "write_file",
]
