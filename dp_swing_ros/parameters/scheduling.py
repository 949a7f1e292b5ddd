# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the operating system schedules a node."""

from dataclasses import dataclass

from dp_swing_ros.parameters import parameter, Parameters


@dataclass(frozen=True)
class SchedulingParameters(Parameters):
    """Whether a node's threads go before those of other programs."""

    thread_priority: int = parameter(
        0, 'real-time priority (SCHED_FIFO) of the threads of the node once it is ready; 0: '
        'scheduled like any other program. For real time only: in lockstep, where nothing waits '
        'for the clock, it would keep all else from the processors', minimum=0, maximum=99,
        live=False)
