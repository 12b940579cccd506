"""What the relay does to messages, and that the catalogue asks for what there is."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faults.damage import Damage, Spoiler


def through(spoiler: Spoiler, messages: list[Any]) -> tuple[list[Any], list[Any]]:
    now: list[Any] = []
    later: list[Any] = []
    for message in messages:
        passed, delayed = spoiler.pass_on(message)
        now += passed
        later += [delayed[1]] if delayed else []
    return now, later


@given(st.integers(0, 200), st.floats(0.0, 1.0), st.sampled_from(("none", "lost", "delayed", "doubled", "swapped")))
def test_nothing_is_made_up_and_only_what_is_lost_is_lost(count: int, share: float, kind: str) -> None:
    spoiler = Spoiler()
    spoiler.set(Damage(kind, share, 0.01))
    now, later = through(spoiler, list(range(count)))
    now += spoiler.set(Damage())  # what is held back goes on at the end
    if kind == "lost":
        assert len(now) == count - spoiler.done
    else:
        assert sorted(set(now) | set(later)) == list(range(count))
        assert len(now) + len(later) == count + (spoiler.done if kind == "doubled" else 0)
    assert (len(later) == spoiler.done) if kind == "delayed" else not later


def test_swapped_messages_change_places_with_the_next_one() -> None:
    spoiler = Spoiler()
    spoiler.set(Damage("swapped", 1.0))
    assert through(spoiler, [0, 1, 2, 3])[0] == [1, 0, 3, 2]


def test_the_share_is_that_of_the_messages() -> None:
    spoiler = Spoiler()
    spoiler.set(Damage("lost", 0.1))
    through(spoiler, list(range(10_000)))
    assert 800 < spoiler.done < 1200


class ImpedanceCommand(SimpleNamespace):
    """Stands for the message by its name and fields."""


def test_numbers_and_stamps_are_spoilt() -> None:
    def command() -> ImpedanceCommand:
        header = SimpleNamespace(stamp=SimpleNamespace(sec=10_000))
        return ImpedanceCommand(header=header, cycle=3, u_tr=0.0, u_tr_next=0.0, f_cat=0.0)

    for kind, fits in (("nan", math.isnan), ("infinity", math.isinf), ("absurd", lambda value: value > 1e9)):
        spoiler = Spoiler()
        spoiler.set(Damage(kind, 1.0))
        found = through(spoiler, [command()])[0][0]
        assert fits(found.u_tr) and fits(found.f_cat) and found.cycle == 3
    spoiler.set(Damage("old_stamp", 1.0))
    assert through(spoiler, [command()])[0][0].header.stamp.sec == 10_000 - 3600
    spoiler.set(Damage("sizes", 1.0))
    with pytest.raises(ValueError, match="sizes"):
        spoiler.pass_on(command())


def test_every_fault_has_a_name_of_its_own_and_damages_what_there_is() -> None:
    pytest.importorskip("phil_interfaces.msg")
    from faults import actions
    from faults.catalogue import FAULTS
    from faults.damage import KINDS
    from faults.relay import LINKS
    from faults.stand import KINDS as KINDS_OF_STANDS
    from faults.stand import RELAYED

    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
    assert sum(fault.short for fault in FAULTS) >= 4
    damages = [fault.action for fault in FAULTS if getattr(fault.action, "func", None) is actions.damage]
    assert {action.keywords["kind"] for action in damages} == set(KINDS) - {"none"}
    stands = {fault.stand for fault in FAULTS if getattr(fault.action, "func", None) is actions.damage}
    assert stands == {f"{RELAYED}{link}" for link in LINKS} <= set(KINDS_OF_STANDS)
