"""When a command is sent again."""

import pytest

from impedance_mpc.asking import EAGER, LONGEST, PATIENCE, Asking

TS = 2e-3


def test_a_command_is_sent_again_within_the_cycle_and_less_often_to_who_stands():
    asking = Asking(TS)
    asking.sent(10.0)
    assert asking.due == pytest.approx(10.0 + PATIENCE * TS)
    waits, now = [], asking.due
    for _ in range(EAGER + 12):
        asking.again(now)
        waits.append(asking.due - now)
        now = asking.due
    assert waits[:EAGER] == pytest.approx([PATIENCE * TS] * EAGER, rel=1e-6)
    assert waits[EAGER : EAGER + 3] == pytest.approx([2 * PATIENCE * TS, 4 * PATIENCE * TS, 8 * PATIENCE * TS])
    assert waits[-1] == pytest.approx(LONGEST)
    asking.sent(now)
    assert asking.times == 0 and asking.due == pytest.approx(now + PATIENCE * TS)
