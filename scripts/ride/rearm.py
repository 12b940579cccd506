"""Re-arms the nodes after a fault: ``python -m ride.rearm``. Everything begins anew with cycle 0.

A rig that retracted stays where it is until somebody says so explicitly, and a node that died and was started again is
unconfigured. Whatever state each node is in, this configures and activates it, or calls its ``~/reset``: first those
that wait for cycle 0, then the rig, which begins with it. A ride that is going on is refused (end it first).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.node import Node
from std_srvs.srv import Trigger

from phil_base.command_line import Parser
from ride.lifecycle import ACTIVATE, CONFIGURE, NEXT, RideError
from ride.settings import NODES

ORDER = ("energy_monitor", "impedance_mpc", "catenary_model", "test_rig_sim")
"""Who is reset when: those that wait for cycle 0 before the catenary, which publishes it, and the rig last of all."""
QUIET_SECONDS = 5.0
"""Time that the nodes have to fall silent: they refuse a reset while cycles come."""
ANSWER_SECONDS = 60.0
AGAIN_SECONDS = 1.0
CONFIGURE_SECONDS = 180.0


def configure(node: Node, spin: Callable[[], None]) -> list[str]:
    """Configure those of the nodes that are not; give what was done, a line each.

    Raises
    ------
    RideError
        A node does not answer or refuses; the text says which.
    """
    done = []
    for name in NODES:
        if state_of(node, name, spin) == "unconfigured":
            change(node, name, CONFIGURE, spin)
            done.append(f"{name} configured")
    return done


def rearm(node: Node, spin: Callable[[], None]) -> list[str]:
    """Bring all nodes to cycle 0 from whatever state they are in; give what was done, a line each.

    Raises
    ------
    RideError
        A node does not answer or refuses; the text says which and why.
    """
    done = configure(node, spin)
    states = {name: state_of(node, name, spin) for name in NODES}
    for name in ORDER:
        _reset(node, name, spin)
        done.append(f"{name} reset")
        if states[name] != "active":
            change(node, name, ACTIVATE, spin)
            done.append(f"{name} activated")
    return done


def state_of(node: Node, name: str, spin: Callable[[], None], seconds: float = ANSWER_SECONDS) -> str:
    """Give the state of a lifecycle node.

    Raises
    ------
    RideError
        It does not answer.
    """
    response = call(node, GetState, f"{name}/get_state", spin, seconds)
    return str(response.current_state.label)


def _reset(node: Node, name: str, spin: Callable[[], None]) -> None:
    deadline = time.monotonic() + QUIET_SECONDS
    while not (answer := call(node, Trigger, f"{name}/reset", spin)).success:
        if time.monotonic() > deadline:
            raise RideError(answer.message)
        again = time.monotonic() + 0.2
        while time.monotonic() < again:
            spin()


def change(node: Node, name: str, transition: int, spin: Callable[[], None]) -> None:
    """Make one transition of a lifecycle node.

    Raises
    ------
    RideError
        It refuses or does not answer.
    """
    request = ChangeState.Request()
    request.transition.id = transition

    def made() -> bool:
        # A node that is at it answers this only when it is done.
        return state_of(node, name, spin, CONFIGURE_SECONDS) == NEXT[transition]

    answer = call(node, ChangeState, f"{name}/change_state", spin, CONFIGURE_SECONDS, request, made)
    if answer is not None and not answer.success:
        raise RideError(f"{name} refused to become {NEXT[transition]}")


def call(
    node: Node,
    kind: Any,
    name: str,
    spin: Callable[[], None],
    seconds: float = ANSWER_SECONDS,
    request: Any = None,
    made: Callable[[], bool] = lambda: False,
) -> Any:
    """Call a service; give its answer, or None if ``made`` says that what was asked for has come about without one.

    The request is sent again each second: a node that was killed is known for a while yet, and takes it to its grave.

    Raises
    ------
    RideError
        No answer comes within ``seconds``.
    """
    client = node.create_client(kind, name)
    futures: list[Any] = []
    try:
        deadline = time.monotonic() + seconds
        again = 0.0
        while not (answered := [future for future in futures if future.done()]):
            now = time.monotonic()
            if now > deadline:
                offered = client.service_is_ready()
                raise RideError(f"{name} did not answer within {seconds:g} s" + ("" if offered else ": is it running?"))
            if now > again and client.service_is_ready():
                if futures and made():
                    return None
                if not any(future.done() for future in futures):
                    futures.append(client.call_async(kind.Request() if request is None else request))
                again = time.monotonic() + AGAIN_SECONDS
            spin()
        return answered[0].result()
    finally:
        node.destroy_client(client)


def main() -> int:
    """Re-arm; 0 if the ride begins anew, else 1."""
    Parser(prog="python -m ride.rearm", description=__doc__.splitlines()[0]).parse_args()
    import rclpy

    from phil_node.executor import events_executor

    rclpy.init()
    node = rclpy.create_node("rearm", start_parameter_services=False)
    executor = events_executor()
    executor.add_node(node)

    def spin() -> None:
        executor.spin_once(timeout_sec=0.05)

    try:
        for line in rearm(node, spin):
            print(line)
    except RideError as error:
        print(f"not re-armed: {error}", file=sys.stderr)
        return 1
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
