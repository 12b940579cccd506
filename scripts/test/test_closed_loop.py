"""Catenary, controller and rig together, in one process and without ROS."""

from __future__ import annotations

import numpy as np
import pytest

from bench.closed_loop import ClosedLoop
from impedance_mpc.controller import RigReading
from ride.settings import resolve


@pytest.fixture
def loop():
    return ClosedLoop(resolve(None, {}))


def test_the_rig_follows_the_wire_and_the_energy_stays_consistent(loop):
    """The nominal rig, with all its imperfections: less than half of the goal of 0.25 mm, half of that of 0.1 %."""
    error = []
    for _ in loop.cycles(2500):
        error.append(loop.rig.state.w_tr - loop.catenary.w_cat)
    books = loop.controller.books
    assert np.sqrt(np.mean(np.square(error[1000:]))) < 0.1e-3
    assert abs(books.delta_work) < 5e-4 * books.exchanged_energy
    assert abs(books.delta_p) < 1e-3 * books.exchanged_momentum


def test_without_correction_energy_drifts(loop):
    """The same ride, correction off: what the correction force is for."""
    loop.controller.control = "integrated"
    for _ in loop.cycles(2500):
        pass
    books = loop.controller.books
    assert abs(books.delta_work) > 5e-4 * books.exchanged_energy


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
                rig_then = RigReading(s.w_tr, s.v_tr, s.f_tr, s.reference, s.work, s.impulse)
                command = controller.command(rig_then, loop.wire())
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
