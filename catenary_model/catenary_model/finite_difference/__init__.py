"""The moving catenary by explicit finite differences, with boundary stencils of `absorbing` at its ends."""

from catenary_model.finite_difference.model import Catenary, check, design_ends, segment_mesh

__all__ = ["Catenary", "check", "design_ends", "segment_mesh"]
