"""The low-pass of the monitor against scipy's, to the last bit: what a ride has filtered stays comparable."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt_zi, sosfreqz

from energy_monitor.butterworth import sections_of, steady_state


@pytest.mark.parametrize("order", range(1, 11))
@pytest.mark.parametrize("rate", [100.0, 150.0, 250.0, 500.0, 1000.0, 2000.0, 5000.0])
@pytest.mark.parametrize("cutoff", [0.5, 5.0, 20.0, 37.3, 49.0])
def test_sections_and_steady_state_are_those_of_scipy(order, rate, cutoff):
    sections = butter(order, cutoff, btype="low", output="sos", fs=rate)
    if order % 2 and cutoff > rate / 4:
        # The real pole may make another section with scipy: the same filter, to rounding.
        (_, ours), (_, theirs) = (sosfreqz(each, 64) for each in (sections_of(order, cutoff, rate), sections))
        assert np.allclose(ours, theirs, rtol=1e-9, atol=1e-12)
    else:
        assert np.array_equal(sections_of(order, cutoff, rate), sections)
    assert np.array_equal(steady_state(sections), sosfilt_zi(sections))


def test_order_below_one_is_refused():
    with pytest.raises(ValueError, match="order 0"):
        sections_of(0, 20.0, 500.0)
