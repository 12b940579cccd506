"""The exit code of the run script follows the verdicts of the report; the ride itself is replaced by its bag."""

from importlib.util import find_spec
from types import SimpleNamespace

import pytest

if find_spec("rclpy") is None or find_spec("phil_interfaces") is None:
    pytest.skip("ROS is not installed", allow_module_level=True)

import ride.session
from ride.command import FAILED, OK, carry_out
from ride.lifecycle import RideError
from ride.options import parse

pytestmark = pytest.mark.slow  # each makes a whole report


@pytest.fixture
def ridden(monkeypatch, tmp_path, synthetic):
    """Run the script's part after the options, on a ride whose bag has these properties."""

    def go(*arguments, error=None, **properties):
        out = tmp_path / "ride"

        class Ride:
            def __init__(self, settings, options, console):
                self.bag_path = out / "bag"
                self.watch = SimpleNamespace(cycle=1499)

            def run(self):
                synthetic(self.bag_path, **properties)
                if error is not None:
                    raise error

        monkeypatch.setattr(ride.session, "Ride", Ride)
        return carry_out(parse(["--out", str(out), *arguments])), out

    return go


def test_a_ride_that_holds_ends_with_0(ridden):
    code, out = ridden()
    assert code == OK
    assert (out / "report.html").is_file()


@pytest.mark.parametrize("properties", [{"lag": 4e-3}, {"last": False}])
def test_a_verdict_that_fails_ends_with_1(ridden, properties, capsys):
    code, out = ridden(**properties)
    assert code == FAILED
    assert (out / "report.html").is_file()
    assert "FAILS" in capsys.readouterr().out


def test_a_ride_that_failed_ends_with_1_though_its_numbers_hold(ridden, capsys):
    code, _ = ridden(error=RideError("catenary_model died"))
    assert code == FAILED
    assert "the ride failed: catenary_model died" in capsys.readouterr().err
