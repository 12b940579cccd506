"""Limits of EN 50367 and the form of the table."""

import pytest

from energy_monitor.contact_quality import ContactStatistics
from energy_monitor.limits import LimitsError, evaluate, load, verdict

STANDARD = load()["en50367_ac"]


def ride(mean=115.0, sigma=30.0, loss_share=0.0, samples=4000):
    return ContactStatistics(samples=samples, mean=mean, sigma=sigma, loss_share=loss_share)


def check(quantity, statistics, speed):
    return next(c for c in evaluate(STANDARD, statistics, speed) if c.quantity == quantity)


@pytest.mark.parametrize(
    ("speed", "low", "high"),
    [
        (0.0, 60.0, 90.0),
        (160.0, 72.032, 102.032),
        (200.0, 78.8, 108.8),
        (200.001, 78.80019, 108.80039),
        (250.0, 89.375, 130.625),
        (320.0, 108.128, 169.328),
    ],
)
def test_mean_force_against_the_formulas_worked_by_hand(speed, low, high):
    found = check("mean", ride(), speed)
    assert found.low == pytest.approx(low, abs=1e-4)
    assert found.high == pytest.approx(high, abs=1e-4)


def test_sigma_is_held_against_the_mean():
    assert check("sigma", ride(mean=100.0, sigma=30.0), 250.0).ok
    assert not check("sigma", ride(mean=100.0, sigma=30.1), 250.0).ok


@pytest.mark.parametrize(
    ("speed", "share", "ok"), [(250.0, 0.001, True), (250.0, 0.0011, False), (251.0, 0.0011, True)]
)
def test_share_of_lost_contact_depends_on_the_speed(speed, share, ok):
    assert check("loss_share", ride(loss_share=share), speed).ok is ok


def test_a_good_ride_passes_and_every_row_names_its_source():
    checks = evaluate(STANDARD, ride(), 250.0)
    assert verdict(checks) is True
    assert [c.quantity for c in checks] == ["mean", "sigma", "loss_share"]
    assert all("EN 50367" in c.source for c in checks)
    assert verdict(evaluate(STANDARD, ride(mean=140.0), 250.0)) is False


def test_no_verdict_without_samples_or_beyond_the_table():
    assert verdict(evaluate(STANDARD, ContactStatistics(), 250.0)) is None
    assert verdict(evaluate(STANDARD, ride(), 500.0)) is None


GOOD = """
mine:
  title: Mine
  checks:
    - quantity: maximum
      name: largest
      unit: N
      source: me
      ranges:
        - {above_kmh: 0, to_kmh: 300, high: {constant: 200}}
"""


def test_a_table_of_ones_own(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(GOOD)
    standard = load(file)["mine"]
    assert verdict(evaluate(standard, ContactStatistics(samples=1, maximum=201.0), 100.0)) is False


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("quantity: maximum", "quantity: colour", "'colour'"),
        ("high:", "hihg:", "'hihg'"),
        ("constant: 200", "constant: many", "'many'"),
        ("source: me", "", "'source' is missing"),
        ("above_kmh: 0", "above_kmh: 400", "below to_kmh"),
        (", high: {constant: 200}", "", "needs low or high"),
        ("{constant: 200}", "{}", "needs one of constant, square, of_mean"),
        ("high:", "low: {constant: 100, square: 0.01}, high:", "low is above high"),
        ("title: Mine", "title:", "title = None has to be a text"),
        ("200}}\n", "200}}\n        - {above_kmh: 310, to_kmh: 400, high: {constant: 1}}\n", "gap or overlap"),
        ("mine:", "mine: [", "no YAML"),
        (GOOD, "", "mapping of standards"),
    ],
)
def test_a_bad_table_is_refused_in_one_line_that_names_the_place(tmp_path, old, new, part):
    file = tmp_path / "mine.yaml"
    file.write_text(GOOD.replace(old, new))
    with pytest.raises(LimitsError) as caught:
        load(file)
    text = str(caught.value)
    assert part in text
    assert str(file) in text
    assert "\n" not in text


def test_a_table_that_is_not_there(tmp_path):
    with pytest.raises(LimitsError, match="cannot be read"):
        load(tmp_path / "none.yaml")
