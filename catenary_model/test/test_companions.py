"""Pantographs that ride along: laws that hold for both discretisations, whatever the numbers are."""

from typing import Any

import numpy as np
import pytest

from catenary_model.build import Config, build
from catenary_model.companions import FORCE, HEIGHT, LOST, PLACE, Companion, motion
from catenary_model.pantograph import Pantograph
from catenary_model.ride import Coupled
from phil_base.lumped import LUMPED

SPEED = 250.0 / 3.6
KINDS = [{"discretisation": "fe"}, {"discretisation": "fd", "grid_boundary": "one_way"}]


def rider(name: str = "three_mass", uplift: float = 120.0) -> Pantograph:
    chain = LUMPED[name]
    return Pantograph.of(chain.masses, chain.damping, chain.stiffness, uplift)


def ride(train: Coupled, cycles: int) -> tuple[np.ndarray, np.ndarray]:
    """Forces of the pantograph at x = 0, (cycles,), and of the companions, (cycles, companions)."""
    beside, forces = [], []
    for _ in range(cycles):
        forces.append(train.go_on(1).F[0])
        beside.append(train.catenary.companions[:, FORCE].copy())
    return np.array(forces), np.array(beside)


@pytest.mark.parametrize("kind", KINDS, ids=["fe", "fd"])
def test_it_does_not_matter_which_of_two_is_called_the_companion(kind: dict[str, Any]) -> None:
    """One train, seen from its first and from its second pantograph: forces agree to 1e-4 N, where rounding ends up.

    The distance is a multiple of both meshes' spacing, so both see the same stations; the domain grows on the side of
    the companion and is the same stretch of line. Both uplifts come up alike.
    """
    d, start = 84.0, 300.0
    first = Coupled(
        build(Config(speed=SPEED, start_position=start, companions=(Companion(rider(), d),), **kind)), rider()
    )
    back = Config(speed=SPEED, start_position=start - d, companions=(Companion(rider(), -d),), **kind)
    second = Coupled(build(back), rider())
    leading, trailing = ride(first, 1500)
    trailing_again, leading_again = ride(second, 1500)
    assert leading[-500:].std() > 5.0  # it does ride over spans
    assert np.abs(leading - leading_again[:, 0]).max() < 1e-4  # N of some hundred
    assert np.abs(trailing[:, 0] - trailing_again).max() < 1e-4


@pytest.mark.parametrize("kind", KINDS, ids=["fe", "fd"])
def test_order_of_companions_does_not_matter(kind: dict[str, Any]) -> None:
    """Three of different kinds, fewer masses among them, in two orders: equal to rounding."""
    several = (Companion(rider("en50318"), 40.5), Companion(rider(uplift=90.0), -60.0), Companion(rider(), 99.0))
    found = []
    for order in ((0, 1, 2), (2, 0, 1)):
        train = Coupled(build(Config(speed=SPEED, companions=tuple(several[i] for i in order), **kind)), rider())
        forces, beside = ride(train, 400)
        places = train.catenary.companions[:, PLACE].tolist()
        assert places == [-several[i].distance for i in order]
        found.append((forces, {i: beside[:, column] for column, i in enumerate(order)}))
    (one, of_one), (other, of_other) = found
    assert np.abs(one - other).max() < 1e-7
    assert all(np.abs(of_one[i] - of_other[i]).max() < 1e-7 for i in range(3))
    assert len({round(float(of_one[i][-1]), 3) for i in range(3)}) == 3


@pytest.mark.parametrize("kind", KINDS, ids=["fe", "fd"])
def test_a_companion_is_not_felt_before_its_waves_have_come(kind: dict[str, Any]) -> None:
    """Behind by d it is felt after d / (c - v), c of the faster wire, and then by newtons.

    Against the same train with a companion that is pulled down and never touches. Tolerance: 0.1 N of 120 N until the
    shortest waves have come, which bending, mesh and step let run at up to 210 m/s (elements: micrometres sooner).
    """
    d = 84.0
    trains = [
        Coupled(build(Config(speed=SPEED, companions=(Companion(rider(uplift=uplift), d),), **kind)), rider())
        for uplift in (120.0, -500.0)
    ]
    line = trains[0].catenary.config.line
    fastest = max(line.carrier.wave_speed, line.contact.wave_speed)
    first, felt_from = (int(d / (c - SPEED) / 0.002) for c in (210.0, fastest))
    felt, alone = (train.go_on(2000).F for train in trains)
    difference = np.abs(felt - alone)
    assert difference[:first].max() < 0.1
    assert difference[felt_from:].max() > 1.0


@pytest.mark.parametrize("kind", KINDS, ids=["fe", "fd"])
def test_at_rest_each_presses_with_its_uplift(kind: dict[str, Any]) -> None:
    """At v = 0 its force is the uplift less what the lowest spring holds, to 0.1 N after 40 s."""
    train = Coupled(build(Config(speed=0.0, companions=(Companion(rider(uplift=90.0), 60.0),), **kind)), rider())
    train.go_on(20_000)
    force, height = train.catenary.companions[0, [FORCE, HEIGHT]]
    lowest = LUMPED["three_mass"].springs[0]
    frame = motion(train.catenary.companions[0], 3)[0, 0]
    assert force == pytest.approx(90.0 - lowest * frame, abs=0.1)
    assert height > 0.01 and train.catenary.companions[0, LOST] == 0.0


@pytest.mark.parametrize("kind", KINDS, ids=["fe", "fd"])
def test_loss_is_the_time_without_contact(kind: dict[str, Any]) -> None:
    """One whose uplift pulls it down never touches once that is up."""
    companion = Companion(rider(uplift=-500.0), 60.0, soft_start=0.1)
    catenary = build(Config(speed=SPEED, companions=(companion,), **kind))
    for _ in range(100):
        catenary.step(120.0)
    force, lost = catenary.companions[0, [FORCE, LOST]]
    assert force == 0.0 and lost == pytest.approx(0.1, abs=catenary.config.step_time * 1.5)


@pytest.mark.parametrize("kind", KINDS, ids=["fe", "fd"])
def test_a_reset_repeats_to_the_last_bit(kind: dict[str, Any]) -> None:
    catenary = build(Config(speed=SPEED, companions=(Companion(rider(), 60.0), Companion(rider(), -30.0)), **kind))
    found = []
    for _ in range(2):
        catenary.reset()
        for k in range(300):
            catenary.step(100.0 + 20.0 * np.sin(0.05 * k))
        found.append((catenary.w_cat, catenary.companions.copy()))
    assert found[0][0] == found[1][0] and np.array_equal(found[0][1], found[1][1])
    assert found[0][1][:, FORCE].max() > 10.0


@pytest.mark.parametrize(
    ("distances", "said"),
    [((0.0,), "must be finite and not 0"), ((3.0,), "3 m apart"), ((2000.0,), r"companions\[0\].distance = 2000 m")],
)
def test_nonsense_is_refused_by_name(distances: tuple[float, ...], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Config(companions=tuple(Companion(rider(), distance) for distance in distances))
