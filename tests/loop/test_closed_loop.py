"""Catenary, controller and rig together, in one process and without ROS."""

from __future__ import annotations

import numpy as np
import pytest

from bench.closed_loop import ClosedLoop
from ride.settings import resolve


@pytest.fixture
def loop():
    return ClosedLoop(resolve(None, {}))


def test_the_rig_follows_the_wire_and_the_energy_stays_consistent(loop):
    """A sixth of the tracking error of a simple prototype with an ideal rig (0.33 mm), half of its energy error."""
    error = []
    for _ in loop.cycles(2500):
        error.append(loop.rig.state.w_tr - loop.catenary.w_cat)
    books = loop.controller.books
    assert np.sqrt(np.mean(np.square(error[1000:]))) < 0.05e-3
    assert abs(books.delta_e) < 5e-4 * books.exchanged_energy
    assert abs(books.delta_p) < 1e-3 * books.exchanged_momentum


def test_without_correction_energy_drifts(loop):
    """The same ride, correction off: what the correction force is for."""
    loop.controller.correcting = False
    for _ in loop.cycles(2500):
        pass
    books = loop.controller.books
    assert abs(books.delta_e) > 5e-4 * books.exchanged_energy
    assert books.delta_p == 0.0


@pytest.mark.parametrize("held_up", [5, 20, 40])
def test_a_loop_that_was_held_up_finds_back(loop, held_up):
    """80 ms without a command, bridged by the rig: no fan-out of the reference, back at the wire within 0.4 s."""
    for _ in loop.cycles(1000):
        pass
    rig, catenary, controller = loop.rig, loop.catenary, loop.controller
    waiting, steps, error = [], [], []
    following = controller.result.u_tr_next
    for k in range(400):
        waiting.append(rig.state)
        command = None
        if k >= held_up:
            for s in waiting:
                q, qd, qdd, held = catenary.state.segment
                wire = (q, qd, qdd, held, catenary.w_cat, catenary.v_cat)
                command = controller.command(s.w_tr, s.v_tr, s.f_tr, *wire, s.reference)
                catenary.step(command.f_cat)
            waiting.clear()
        start = rig.state.reference if command is None else command.u_tr
        end = following if command is None else command.u_tr_next
        steps.append(max(abs(start - rig.state.reference), abs(end - start)))
        following = end
        rig.advance(start, end)
        error.append(rig.state.w_tr - catenary.w_cat)
    assert max(steps) < 0.01
    assert np.abs(error[held_up + 200 :]).max() < 0.5e-3
