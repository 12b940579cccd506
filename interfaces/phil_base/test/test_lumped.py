"""Pantographs as chains of masses: what their matrices mean."""

import numpy as np
import pytest

from phil_base.lumped import LUMPED, Lumped


@pytest.mark.parametrize("data", LUMPED.values(), ids=LUMPED)
def test_matrices_are_those_of_a_chain_that_hangs_on_the_car_body(data: Lumped) -> None:
    """Equal displacement of all masses stretches the lowest link alone; a link pulls its two masses by its length."""
    n = len(data.masses)
    assert n == len(data.springs) == len(data.dashpots) and data.source
    for matrix, links in ((data.stiffness, data.springs), (data.damping, data.dashpots)):
        assert np.allclose(matrix @ np.ones(n), [links[0], *[0.0] * (n - 1)], atol=1e-9 * max(links))
        y = np.arange(1.0, n + 1) ** 2
        stretch = np.diff(y, prepend=0.0) * links
        assert np.allclose(matrix @ y, stretch - np.append(stretch[1:], 0.0))
