# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The shadows of an mpc: other solvers that answer its ticks, and what they report."""

from collections.abc import Mapping
from threading import Thread
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from dp_swing_ros.nodes.diagnostics import Diagnostics
from dp_swing_ros.nodes.messages import to_stamp
from dp_swing_ros.nodes.process import ProcessNode
from dp_swing_ros.rerun.answers import Tick
from dp_swing_ros.rerun.shadow import Shadow


class Shadows:
    """Begins and ends them as the parameter `shadow` says, and publishes their answers."""

    def __init__(self, node: ProcessNode, diagnostics: Diagnostics) -> None:
        """Begin with none."""
        self.node, self.diagnostics = node, diagnostics
        self.shadows: dict[str, Shadow] = {}

    def configure(self, values: Mapping[str, Any], wait: bool = False) -> None:
        """Follow an mpc of these parameters; with `wait`, until all shadows are ready."""
        wanted = [solver for solver in values['shadow'] if solver]
        for solver in set(self.shadows) - set(wanted):
            Thread(target=self.shadows.pop(solver).close).start()   # which may wait for it
        for solver in wanted:
            if solver in self.shadows:
                self.shadows[solver].change(dict(values))
            else:
                self.shadows[solver] = Shadow(solver, dict(values))
        if wait:
            self.publish_answers(wait)

    def follow(self, tick: Tick) -> None:
        """Give them a tick; publish what they answer, in lockstep to this one, else to others."""
        for solver, shadow in list(self.shadows.items()):
            try:
                shadow.follow(tick)
            except ConnectionError:
                self.lose(solver)
        self.publish_answers(wait=not tick.real_time)

    def publish_answers(self, wait: bool) -> None:
        """Publish the answers that have come, or, with `wait`, all that will come."""
        for solver, shadow in list(self.shadows.items()):
            try:
                for answer in shadow.answers(wait):
                    self.diagnostics.publish(
                        to_stamp(answer.stamp), DiagnosticStatus.OK, answer.status,
                        {**answer._asdict(), 'behind': shadow.behind}, part=f'shadow {solver}')
            except ConnectionError:
                self.lose(solver)

    def lose(self, solver: str) -> None:
        """Go on without a shadow that has ended by itself."""
        shadow = self.shadows.pop(solver)
        shadow.close()
        text = (f'the shadow {solver} has ended with exit code {shadow.process.returncode}; going '
                'on without it. Set the parameter shadow anew to begin it again')
        self.node.get_logger().error(text)
        self.diagnostics.publish(self.node.get_clock().now().to_msg(), DiagnosticStatus.ERROR,
                                 text, {}, part=f'shadow {solver}')

    def close(self) -> None:
        """End them all."""
        for shadow in self.shadows.values():
            shadow.close()
