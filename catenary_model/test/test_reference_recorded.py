"""A ride and a given force on the reference as they were recorded, so that nobody changes them unawares.

The numbers are those of the model with one pantograph at a constant speed. They are held to 1e-9, not to the last bit:
inverse and equilibrium come from LAPACK and SuperLU, which round otherwise on another processor.
"""

import numpy as np
from test_reference_step import CONFIG, PANTOGRAPH

from catenary_model.reference import Reference

EVERY = 60
FORCE = [
    *(0.0, 79.85707130495612, 235.75742935025923, 262.71810742931495, 248.0444844993473),
    *(329.74039320557875, 290.25259863249704, 226.99233029019376, 283.7670951348406, 233.87257690776866),
]
HEIGHT = [
    *(-0.0009840117399712287, 0.002916156613427847, 0.022705885708653218, 0.050067835342441226, 0.07563855511352806),
    *(0.0917432431117631, 0.09392927406762287, 0.0945772424645716, 0.0896839833522053, 0.08266419890684877),
]
VELOCITY = [
    *(0.06817965245199602, 0.17711226975190547, 0.4947827284995193, 0.39298105898486285, 0.37434425033055224),
    *(0.27865166233035277, 0.0155044803776693, 0.029280023972373892, -0.3528378563024732, -0.05814290545801823),
]
HEAD = [
    *(-0.0020405874241657645, 0.00451329803952697, 0.027421034295658408, 0.055322197491027514, 0.08059944480351501),
    *(0.0983380509758747, 0.09973432604027281, 0.09911708907037547, 0.09535932525490211, 0.08734165044500414),
]
SLACK = [0, 0, 1, 2, 2, 2, 3, 4, 2, 3]
UPLIFT = [
    *(0.0008836786515378533, -0.0006008717650715262, -0.011687132820462657, 0.016937944804891872, 0.021677071874005322),
    5.451910173633591e-05,
]
PUSHED = [
    *(0.014675604491798533, 0.02078303179784143, 0.030740085814304246, 0.033755398885144346, 0.03473537999270551),
]


def test_a_ride_is_as_it_was_recorded() -> None:
    """Slack droppers, contact lost and found again, steady arms and masts."""
    record = Reference(CONFIG).ride(PANTOGRAPH, 0.6, ramp=0.1)
    at = slice(EVERY - 1, None, EVERY)
    for found, recorded in zip(
        (record.F, record.w, record.v, record.head), (FORCE, HEIGHT, VELOCITY, HEAD), strict=True
    ):
        np.testing.assert_allclose(found[at], recorded, rtol=0, atol=1e-9 * np.abs(recorded).max())
    assert record.slack[at].tolist() == SLACK
    assert int((record.F <= 0.0).sum()) == 59
    np.testing.assert_allclose(record.uplift[-1], UPLIFT, rtol=0, atol=1e-9 * np.abs(UPLIFT).max())
    np.testing.assert_array_equal(record.zeta, 35.0 + 60.0 * (1e-3 * np.arange(1, 601)))


def test_a_given_force_is_as_it_was_recorded() -> None:
    record = Reference(CONFIG).push(np.full(200, 150.0))
    np.testing.assert_allclose(record.w[39::40], PUSHED, rtol=0, atol=1e-9 * np.abs(PUSHED).max())
