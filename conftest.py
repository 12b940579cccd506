"""Every test session rides on ROS domains of its own: no talk with a ride on this machine, or with another session.

Nodes in the test's own process leave their DDS participant behind (rclpy destroys a lifecycle node's with the process),
and the run script refuses a domain on which its nodes are already. So rides in processes of their own have another
domain than nodes in this one, and so have the catenary's and the controller's node.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
from pathlib import Path
from typing import IO

from hypothesis import settings


def _claim_domain(variable: str) -> IO[str]:
    """Take the first free domain from 101 down into an environment variable; the lock lives as long as this process."""
    for domain in range(101, 10, -1):
        path = Path(tempfile.gettempdir()) / f"phil-tests-domain-{domain}"
        handle = path.open("w")
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            handle.close()
            continue
        os.environ[variable] = str(domain)
        return handle
    raise RuntimeError("no ROS domain from 11 to 101 is free for the tests")


_CLAIMS = [
    _claim_domain(variable)
    for variable in (
        "ROS_DOMAIN_ID",
        "PHIL_TEST_DOMAIN_RIDES",
        "PHIL_TEST_DOMAIN_CATENARY",
        "PHIL_TEST_DOMAIN_CONTROLLER",
    )
]
if not os.environ.get("ROS_LOCALHOST_ONLY"):
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

# The first example of a test may compile a kernel, which takes seconds: time is no property that is tested here.
# The same examples each time, so that a change is judged by what it changes; new ones are looked for with
# `scripts/test.sh --hypothesis-profile=explore`.
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, derandomize=False, print_blob=True)
settings.load_profile("repeatable")
