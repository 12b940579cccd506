"""One process a node: who claims the name, and for how long."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from phil_node.instance import AlreadyRunning, claim, claimed

DOMAIN = 1000 + os.getpid()  # no domain that exists: other sessions claim names, too
RIG = "/test_rig_sim"


def test_the_second_claim_is_refused_in_one_line_that_names_the_first() -> None:
    with claim(RIG, DOMAIN):
        with pytest.raises(AlreadyRunning) as caught:
            claim(RIG, DOMAIN)
        text = str(caught.value)
        assert "\n" not in text and f"(process {os.getpid()})" in text and "ROS_DOMAIN_ID" in text
        assert claimed(RIG, DOMAIN)
    assert not claimed(RIG, DOMAIN)
    claim(RIG, DOMAIN).close()


def test_another_name_namespace_or_domain_is_another_node() -> None:
    long = "/" + "a" * 300
    others = [
        (RIG, DOMAIN + 1),
        (f"/rig_b{RIG}", DOMAIN),
        (f"{RIG}_2", DOMAIN),
        (f"{long}1", DOMAIN),
        (f"{long}2", DOMAIN),
    ]
    with claim(RIG, DOMAIN):
        held = [claim(*other) for other in others]
    for one in held:
        one.close()


def test_a_killed_process_holds_nothing() -> None:
    code = f"from phil_node.instance import claim; c = claim({RIG!r}, {DOMAIN}); print('held', flush=True); input()"
    first = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert first.stdout is not None and first.stdout.readline() == "held\n"
    with pytest.raises(AlreadyRunning, match=rf"process {first.pid}\)"):
        claim(RIG, DOMAIN)
    first.kill()
    first.communicate()
    claim(RIG, DOMAIN).close()
