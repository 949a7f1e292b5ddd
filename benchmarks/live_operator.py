# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node that does to running nodes what a user would, and hears what comes of it."""

from array import array
from collections.abc import Callable
from contextlib import ExitStack
import time
from typing import Any, NamedTuple

from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python

from dp_swing_ros.messages.fields import from_diagnostics, Report, seconds, to_state
from dp_swing_ros.nodes.connections import QUEUE, subscribe
from dp_swing_ros.pendulum.state import Array, DEFAULT_LINKS
from dp_swing_ros.tools.tool_node import listeners, tool_node
from dp_swing_ros.topics import DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES

PATIENCE = 60.0   # [s] for an answer


class Heard(NamedTuple):
    """A state: when it came, by the monotonic clock [s], its stamp [s], and itself (2n + 2,)."""

    at: float
    stamp: float
    x: Array


class Operator:
    """The node, used as a context manager; it hears only while it waits."""

    def __init__(self, links: int = DEFAULT_LINKS) -> None:
        """Take the number of links of the pendulum."""
        self.links = links
        self.states: list[Heard] = []
        self.forces: list[tuple[float, float]] = []   # when each came [s], and itself [N]
        self.reports: dict[str, list[Report]] = {'mpc': [], 'plant': []}

    def __enter__(self) -> 'Operator':
        self._exit = ExitStack()
        self.node = self._exit.enter_context(tool_node('operator'))
        self.executor = SingleThreadedExecutor(context=self.node.context)
        self._exit.callback(self.executor.shutdown)
        self.executor.add_node(self.node)
        self.clients: dict[str, Any] = {}
        subscribe(self.node, JOINT_STATES, self._state, depth=QUEUE)
        subscribe(self.node, FORCE_COMMAND, self._force, depth=QUEUE)
        subscribe(self.node, DIAGNOSTICS, self._diagnostics, depth=QUEUE)
        return self

    def __exit__(self, *error: object) -> None:
        self._exit.close()

    def _state(self, message: Any) -> None:
        self.states.append(Heard(time.monotonic(), seconds(message.header.stamp),
                                 to_state(message, self.links)))

    def _force(self, message: Any) -> None:
        self.forces.append((time.monotonic(), message.data))

    def _diagnostics(self, message: Any) -> None:
        for node, reports in self.reports.items():
            report = from_diagnostics(message, node)
            if report is not None:
                reports.append(report)

    def wait(self, duration: float) -> None:
        """Hear for a time [s]."""
        self.until(lambda: False, duration)

    def until(self, condition: Callable[[], Any], patience: float = PATIENCE) -> bool:
        """Hear until a condition holds; return whether it does."""
        end = time.monotonic() + patience
        while not condition() and (left := end - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=min(left, 0.1))
        return bool(condition())

    def meet(self, *names: str) -> None:
        """Wait until nodes hear the states; raises TimeoutError."""
        if not self.until(lambda: set(names) <= listeners(self.node), 3 * PATIENCE):
            raise TimeoutError(f'{" and ".join(names)} do not come up')

    def call(self, kind: Any, name: str, **request: Any) -> Any:
        """Call a service and return what it answers; raises TimeoutError."""
        if name not in self.clients:
            self.clients[name] = self.node.create_client(kind, name)
        client = self.clients[name]
        if not self.until(client.service_is_ready):
            raise TimeoutError(f'nobody offers {name}')
        answer = client.call_async(kind.Request(**request))
        if not self.until(answer.done):
            raise TimeoutError(f'{name} does not answer')
        return answer.result()

    def put(self, node: str, **values: Any) -> str:
        """Set parameters of a node, all or none; return why they are refused, if they are."""
        answer = self.call(
            SetParametersAtomically, f'{node}/set_parameters_atomically',
            parameters=[Parameter(name.replace('__', '.'), value=value).to_parameter_msg()
                        for name, value in values.items()])
        return '' if answer.result.successful else answer.result.reason or 'without a reason'

    def value(self, node: str, name: str) -> Any:
        """Return the value of a parameter of a node."""
        found, = self.call(GetParameters, f'{node}/get_parameters',
                           names=[name.replace('__', '.')]).values
        value = parameter_value_to_python(found)
        return list(value) if isinstance(value, array) else value

    def counted(self, node: str, name: str) -> int:
        """Return what a node counts, as it said last; 0 where it says nothing of it."""
        found = [report.values[name] for report in self.reports[node] if name in report.values]
        return int(found[-1]) if found else 0
