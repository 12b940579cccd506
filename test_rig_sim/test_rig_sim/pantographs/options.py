"""What a pantograph takes from the rig's parameters when it is built."""

from typing import NamedTuple

from test_rig_sim.pantographs.frame import Frame


class Options(NamedTuple):
    """Parameters that one pantograph or another reads; without them it has its own data alone."""

    frame: Frame = Frame()  # laws on the frame, at the train's speed
    file: str = ""  # path of a pantograph file


STANDARD = Options()
