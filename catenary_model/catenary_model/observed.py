"""What every model of the moving catenary shows of its state, and what others may ask of it."""

# ruff: noqa: D102 - what a member means is said where it is implemented, in `Observed` and the models

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from catenary_model import companions, layout, pantograph, wire_view
from catenary_model.config import Config
from catenary_model.moving_frame import Mesh
from catenary_model.reduced import ReducedModel
from catenary_model.statics import Statics

Array = NDArray[np.float64]


NOBODY: Array = np.zeros((0, companions.MOTION))
"""Rows of companions where there are none."""


class _State(Protocol):
    """Arrays that all models have, see `layout.State`."""

    def __iter__(self) -> Iterator[NDArray[Any]]: ...
    @property
    def counter(self) -> NDArray[np.int64]: ...
    @property
    def point(self) -> Array: ...
    @property
    def segment(self) -> Array: ...


class MovingCatenary(Protocol):
    """A catenary in the frame of the train, whatever it is discretised by; `build.build` makes one.

    A cycle is `step`; `ride_on` and `push_on` are cycles in compiled code, for `ride`.
    """

    config: Config
    mesh: Mesh
    statics: Statics
    reduced: ReducedModel

    @property
    def state(self) -> _State: ...
    def step(self, f_cat: float) -> None: ...
    def reset(self) -> None: ...
    @property
    def cycle(self) -> int: ...
    @property
    def w_cat(self) -> float: ...
    @property
    def v_cat(self) -> float: ...
    @property
    def a_cat(self) -> float: ...
    @property
    def f_cat(self) -> float: ...
    @property
    def work(self) -> float: ...
    @property
    def impulse(self) -> float: ...
    @property
    def local_compliance(self) -> float: ...
    @property
    def track_position(self) -> float: ...
    @property
    def droppers(self) -> int: ...
    @property
    def slack_droppers(self) -> int: ...
    @property
    def iterations(self) -> int: ...
    @property
    def unsettled_steps(self) -> int: ...
    @property
    def segment_displacement(self) -> Array: ...
    @property
    def segment_velocity(self) -> Array: ...
    @property
    def segment_acceleration(self) -> Array: ...
    @property
    def segment_force(self) -> Array: ...
    @property
    def companions(self) -> Array: ...
    @property
    def rider_newmark(self) -> tuple[float, float]: ...
    def wire_shape(self) -> wire_view.WireView: ...
    def ride_on(
        self, constants: pantograph.Constants, state: pantograph.State, soft_start: float, held: float, out: Array
    ) -> None: ...
    def push_on(self, force: Array, out: Array) -> None: ...


def rewind(state: _State, sites: int, config: Config, mesh: Mesh) -> None:
    """Clear all state of a model whose line has so many sites a period, for cycle 0 at the start position."""
    pushed = state.counter[layout.PUSHED]  # whoever has the view of external loads may write into it again
    for array in state:
        array.fill(0)
    state.counter[layout.PUSHED] = pushed
    behind = math.floor((config.start_position - mesh.behind) / config.line.period) - 1
    state.counter[layout.FIRST_SITE] = state.counter[layout.NEXT_SITE] = behind * sites


class Scheme(NamedTuple):
    """Compiled functions of a discretisation."""

    start: Callable[..., None]
    """Of both bundles: list the sites for the present instant and observe it."""
    cycle: Callable[..., None]
    """Of a packed arena and a force, see `cycle.cycles`."""
    run: Callable[..., None]
    """See `coupled.run`."""
    push: Callable[..., None]
    """See `coupled.push_by`."""


class Observed:
    """What all models do with the arrays that they have, and public members that only look at these."""

    config: Config
    mesh: Mesh
    scheme: Scheme
    constants: Any
    state: Any
    _packed: list[Any]

    def reset(self) -> None:
        """Go back to rest at the start position, cycle 0; no external load."""
        rewind(self.state, len(self.constants.site), self.config, self.mesh)
        if self.config.companions:
            companions.begin(self.config.companions, self.constants, self.state)
        self.scheme.start(self.constants, self.state)

    def step(self, f_cat: float) -> None:
        """Advance one cycle with the contact force f_cat (N, up positive) as the force of the new instant."""
        self.scheme.cycle(*self._packed, f_cat)

    def ride_on(
        self, constants: pantograph.Constants, state: pantograph.State, soft_start: float, held: float, out: Array
    ) -> None:
        """Ride as many cycles as `out` has rows, see `coupled.run`."""
        self.scheme.run(self.constants, self.state, constants, state, soft_start, held, out)

    def push_on(self, force: Array, out: Array) -> None:
        """Advance one cycle a given force (N)."""
        self.scheme.push(self.constants, self.state, force, out)

    @property
    def cycle(self) -> int:
        """Cycle number k of the present state."""
        return int(self.state.counter[layout.STEPS]) // self.config.steps_per_cycle

    @property
    def w_cat(self) -> float:
        """Displacement of the contact wire at the pantograph from its nominal height, m."""
        return float(self.state.point[layout.W_CAT])

    @property
    def v_cat(self) -> float:
        """Its rate of change in the frame of the train, m/s."""
        return float(self.state.point[layout.V_CAT])

    @property
    def a_cat(self) -> float:
        """Its second rate of change, m/s^2."""
        return float(self.state.point[layout.A_CAT])

    @property
    def f_cat(self) -> float:
        """Contact force that acted in the last step, N."""
        return float(self.state.point[layout.F_CAT])

    @property
    def work(self) -> float:
        """Work that the contact force did on the wire since cycle 0, J: trapezoids of an integration step each."""
        return float(self.state.point[layout.WORK])

    @property
    def impulse(self) -> float:
        """Integral of the contact force since cycle 0, N s."""
        return float(self.state.point[layout.IMPULSE])

    @property
    def track_position(self) -> float:
        """Position of the pantograph along the line, m."""
        return float(self.state.point[layout.ZETA])

    @property
    def droppers(self) -> int:
        """Droppers within the domain."""
        return int(self.state.counter[layout.DROPPERS])

    @property
    def slack_droppers(self) -> int:
        """Of these, slack ones."""
        return int(self.state.counter[layout.SLACK])

    @property
    def iterations(self) -> int:
        """Solves of the last step."""
        return int(self.state.counter[layout.ITERATIONS])

    @property
    def unsettled_steps(self) -> int:
        """Steps since the start whose slack state was not consistent after the most solves allowed."""
        return int(self.state.counter[layout.UNSETTLED])

    @property
    def segment_displacement(self) -> Array:
        """Displacements q of the reduced model, m and rad, (n,); a view that the next step overwrites."""
        return self.state.segment[0]

    @property
    def segment_velocity(self) -> Array:
        """Velocities q' of the reduced model, m/s and rad/s, (n,); a view."""
        return self.state.segment[1]

    @property
    def segment_acceleration(self) -> Array:
        """Accelerations q'' of the reduced model, (n,); a view."""
        return self.state.segment[2]

    @property
    def segment_force(self) -> Array:
        """Held forces f_held of the reduced model, N and N m, (n,); a view."""
        return self.state.segment[3]

    @property
    def companions(self) -> Array:
        """Companions, a row each, columns `companions.PLACE`, `FORCE`, `HEIGHT`, `LOST`, ...: (n, 7), a view."""
        return getattr(self.state, "aside", NOBODY)
