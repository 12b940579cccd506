"""Every test session rides on a ROS domain of its own: no talk with a ride on this machine, or with another session."""

from __future__ import annotations

import fcntl
import os
import tempfile
from pathlib import Path
from typing import IO

import pytest
from hypothesis import settings


def _claim_domain() -> IO[str]:
    """Take the first free domain from 101 down; the lock on its file holds as long as this process lives."""
    for domain in range(101, 10, -1):
        path = Path(tempfile.gettempdir()) / f"phil-tests-domain-{domain}"
        handle = path.open("w")
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            handle.close()
            continue
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        if not os.environ.get("ROS_LOCALHOST_ONLY"):
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        return handle
    raise RuntimeError("no ROS domain from 11 to 101 is free for the tests")


_CLAIM = _claim_domain()

# The first example of a test may compile a kernel, which takes seconds: time is no property that is tested here.
# The same examples each time, so that a change is judged by what it changes; new ones are looked for with
# `scripts/test.sh --hypothesis-profile=explore`.
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None, derandomize=False, print_blob=True)
settings.load_profile("repeatable")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep a file's tests on one worker (`-n 2 --dist loadgroup`), and all that start the nodes on the same one."""
    if config.pluginmanager.hasplugin("xdist"):
        for item in items:
            group = "rides" if item.get_closest_marker("integration") else str(item.path)
            item.add_marker(pytest.mark.xdist_group(group))
