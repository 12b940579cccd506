"""Real nodes in processes of their own, and a client in this one that spins, asks and ends them."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any


class Client:
    """Starts nodes and has a node of its own; ``status`` is the newest diagnostics of every node."""

    def __init__(self, environment: dict[str, str], own: str, nodes: dict[str, list[str]]) -> None:
        """Start the nodes (package and command-line words of each); be called ``own``."""
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        # A ride in lockstep takes what processors there are, and this observer has to keep up with it.
        ordinary = ["--ros-args", "-p", "real_time.scheduling:=ordinary"]
        self.processes = [
            subprocess.Popen(
                [sys.executable, "-m", f"{name}.node", *words, *ordinary], env=environment, start_new_session=True
            )
            for name, words in nodes.items()
        ]
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO, domain_id=int(environment["ROS_DOMAIN_ID"]))
        self.node = rclpy.create_node(own)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.status: dict[str, Any] = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._take_status, 10)

    def _take_status(self, message: Any) -> None:
        for status in message.status:
            self.status[status.hardware_id.rsplit("/", 1)[-1]] = status

    def spin(self) -> None:
        self.executor.spin_once(timeout_sec=0.05)

    def until(self, condition: Callable[[], bool], seconds: float = 20.0) -> bool:
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            if condition():
                return True
            self.spin()
        return condition()

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service and wait for its answer."""
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(20.0)
        future = client.call_async(request)
        assert self.until(future.done)
        return future.result()

    def set_on(self, node: str, **values: Any) -> Any:
        """Set parameters; give what the node says of the first one."""
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter

        listed = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParameters.Request(parameters=listed)
        return self.call(SetParameters, f"{node}/set_parameters", request).results[0]

    def close(self) -> None:
        """End the nodes; one that does not end by itself is a failure."""
        import rclpy

        for process in self.processes:
            process.terminate()
        for process in self.processes:
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()
