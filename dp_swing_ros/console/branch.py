# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
`python -m dp_swing_ros.console.branch BAG AT DURATION ORIGIN`: what each solver would do.

Writes lines of JSON: of its progress, and at the end of what it found. Times are those of the
stamps, less an origin [s].
"""

from collections.abc import Callable
import json
import sys
from typing import Any

import numpy as np

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.console.scene import number, numbers
from dp_swing_ros.errors import UserError
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.rerun.counterfactual import counterfactual, Run
from dp_swing_ros.solvers import SOLVERS

LEAD = 5.0      # [s] before the instant that solvers see, too
EARLY = 1e-6    # [s] by which a time in JSON may be late

Send = Callable[[dict[str, Any]], object]


def main(argv: list[str]) -> int:
    """Let each solver take over; print lines of JSON."""
    def send(message: dict[str, Any]) -> None:
        print(json.dumps(message, allow_nan=False), flush=True)

    bag, *times = argv
    try:
        at, duration, origin = map(float, times)
        branch(Bag(bag), at, duration, origin, send)
    except (UserError, ParameterError) as error:
        send({'progress': 1.0, 'trajectories': None, 'text': str(error)})
    return 0


def branch(bag: Bag, at: float, duration: float, origin: float, send: Send) -> None:
    """
    Let each solver take over at a time [s], for a duration [s] or as long as was recorded then.

    Raises UserError and ParameterError where there is no such tick, or a bag lacks something.
    """
    run, solvers = Run(bag), list(SOLVERS)
    start = run.start / BILLION - origin
    if at < start - run.period / BILLION:
        raise UserError(f'what was heard at {at:.2f} s is not kept any more; look back anew')
    tick = run.tick_at(max(at - start - EARLY, 0.0), None)
    duration = min(duration, run.time(run.end) - run.time(tick.stamp))
    done = 0

    def progress() -> None:
        nonlocal done
        done += 1
        send({'progress': done / (len(solvers) + 1), 'trajectories': None, 'text': ''})

    found = counterfactual(run.lately(tick.stamp - round(LEAD * BILLION)), tick, solvers,
                           duration, progress)
    send({'at': start + found.at, 'progress': 1.0, 'text': f'{duration:.2f} s', 'trajectories': {
        name: {'t': numbers(one.t + start, 6), 'X': numbers(one.X), 'U': numbers(one.U),
               'cost': number(one.cost), 'regret': number(found.regret(one)),
               'settled': numbers(np.array([one.settled + start]), 6)[0]}
        for name, one in found.trajectories().items()}})


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
