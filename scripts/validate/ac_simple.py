"""A ride like that of EN 50318:2018's model AC simple, for comparison: its line and pantograph were not read in it.

What stands in for them: the preset `pre_sag_steady_arm` as it is (spans of 55 m, 22 and 16 kN; see the file for what of
it is typical and what is assumed) and the rig's `three_mass` pantograph, with the force on its frame that gives EN
50367's mean force. Ten spans in the middle of 28, of which spans 5 and 6 are evaluated, as for the edition of 2002.
"""

from __future__ import annotations

from collections.abc import Callable

from catenary_model.line_file import load_line
from catenary_model.reference import Config, Pantograph, Reference, Ride
from test_rig_sim.pantographs import PANTOGRAPHS
from validate.mean_force import target

LINE, PANTOGRAPH = "pre_sag_steady_arm", "three_mass"
SPAN = load_line(LINE).spans[0].length
"""m."""
CONTACT_STIFFNESS = 50e3
"""N/m."""
BEFORE, ALL = 9, 28
"""Spans of the mesh before the ten, spans of the mesh."""
START, END = 0.5 * SPAN, 9.5 * SPAN
"""The pantograph rides from the middle of span 1 to the middle of span 10, m."""
FIRST, LAST = 4 * SPAN, 6 * SPAN
"""Spans 5 and 6, m."""
RAMP = 1.0
"""Time within which the static force comes up, s."""


def ride(speed: float, element_length: float, time_step: float, say: Callable[[str], None]) -> Ride:
    """Ride over the ten spans at `speed` km/h; the second ride of two has the mean force of EN 50367.

    On average F = f_up - k y_frame, and y_frame rises by the wire's compliance a newton, so F is nearly a fixed share
    of f_up: one correction brings it within 1 N. Raises RuntimeError for unsettled steps.
    """
    v, wanted = speed / 3.6, target(speed)
    chain, uplift = PANTOGRAPHS[PANTOGRAPH](), wanted
    reference = Reference(
        Config(
            line=load_line(LINE),
            speed=v,
            spans=ALL,
            first_span=-BEFORE,
            start_position=START,
            element_length=element_length,
            time_step=time_step,
        )
    )
    for last in (False, True):
        rider = Pantograph.of(chain.mass, chain.damping, chain.stiffness, uplift, CONTACT_STIFFNESS)
        say(f"{speed:g} km/h, {LINE}, {uplift:.1f} N on the frame")
        record = reference.ride(rider, (END - START) / v - time_step, ramp=RAMP)
        if reference.unsettled_steps:
            raise RuntimeError(f"{reference.unsettled_steps} steps at {speed:g} km/h have no consistent slack state")
        if not last:
            uplift *= wanted / float(record.F[record.between(FIRST, LAST)].mean())
    return record
