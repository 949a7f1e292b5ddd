# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What `identify` finds of the plausible rig, config/rig.yaml, and what the mpc gains by it.

Each seed is half a minute of the rig, moved by MuJoCo, in one of several motions; the mpc knows
its nominal parameters alone. Then the mpc swings the rig up with what the first seed found, and
with what it learns by itself, from the same starts.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from joblib import delayed, Parallel
import numpy as np

from dp_swing_ros import declarations
from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.evaluation.comparison import paired
from dp_swing_ros.evaluation.metrics import measure, Metrics
from dp_swing_ros.identification.identify import Identified, identify
from dp_swing_ros.identification.segments import Motion
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array, hanging
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.tables import aligned

RIG = Path('config/rig.yaml')
DURATION, SWING_UP = 30.0, 10.0   # [s] of a motion, and of a swing-up
APART = 3.0                       # [s] between pushes
STRONGEST = 30.0                  # [N] of them
HELD, FREE = 4.0, 2.0             # [s] under control, and without, again and again
NEARLY = 1e-3                     # [SI] standard deviation of a start from hanging
WITHIN = 0.03                     # of itself, to which a parameter is to be found
DRY, LATE = 0.15, 0.003           # of a friction; [s] of a delay or time constant
RUB = {'cart': 0.05, 'joint': 0.005}  # [N s/m, N m s/rad] viscous friction that none may pass for
MOTIONS = {'held': 'swing-up and hold', 'pushed': 'swing-up and hold, a push every 3 s',
           'again': 'swing-up, 4 s under control and 2 s without, again and again'}


class Recorder:
    """A controller and what it was given; of some motions it is in command for a while alone."""

    def __init__(self, controller: RecedingHorizon, motion: str, limit: float) -> None:
        """Take the controller, the motion and the largest force [N]."""
        self.controller, self.motion, self.limit = controller, motion, limit
        self.t, self.X, self.U = list[float](), list[Array](), list[float]()

    def update(self, t: float, x: Array, delay: float) -> Plan:
        """Answer a state, and remember both."""
        if self.motion == 'again' and t % (HELD + FREE) > HELD:
            self.controller.reset()
            plan = self.controller.fallback(t)   # which is zero
        else:
            plan = self.controller.update(t, x, delay)
        self.t.append(t)
        self.X.append(x)
        self.U.append(plan.first_force(self.limit))
        return plan

    def fallback(self, begins: float) -> Plan:
        """Answer a state that is lost."""
        return self.controller.fallback(begins)


def rig(seed: int, **others: Any) -> dict[str, Any]:
    """Return the parameters of the rig's plant, nearly hanging."""
    random = np.random.default_rng((1, seed))
    start = hanging() + random.normal(0.0, NEARLY, len(hanging()))
    return {**declarations.read([RIG])['plant'], 'seed': seed, 'initial_state': start.tolist(),
            **others}


def record(seed: int, motion: str = 'pushed', duration: float = DURATION,
           **others: Any) -> Motion:
    """Return a motion of the rig as its sensors see it, under an mpc that is told nothing."""
    plant = plants.plant(rig(seed, **others))
    limits, rate = plant.limits, plant.parameters.rate
    pushes = np.zeros(round(duration * rate))
    if motion == 'pushed':
        every = round(APART * rate)
        random = np.random.default_rng((2, seed))
        pushes[every::every] = random.uniform(-STRONGEST, STRONGEST, len(pushes[every::every]))
    recorder = Recorder(controllers.controller({'seed': seed}), motion, limits.force_limit)
    simulate(plant, recorder, duration, pushes=pushes)
    Q = np.hsplit(np.array(recorder.X), 2)[0]
    Q[:, 1:] = np.unwrap(Q[:, 1:], axis=0)
    t = np.array(recorder.t)
    return Motion(t, Q, t, np.array(recorder.U), np.nonzero(pushes)[0] / rate, limits.track_limit)


def identified(seed: int, motion: str) -> Identified:
    """Record a motion and identify the rig."""
    return identify([record(seed, motion)], PendulumParameters())


def truth() -> dict[str, float]:
    """Return the parameters of the rig."""
    plant = plants.plant(rig(0))
    return {**vars(plant.physical), **vars(plant.drive)}


def allowed(name: str, value: float) -> float:
    """Return by how much a found value may differ from the true one."""
    if name.endswith('_dry_friction'):
        return DRY * value
    if name.endswith('_friction'):
        return RUB[name[:-9].rstrip('123_')]
    if name in ('actuation_delay', 'motor_time_constant'):
        return LATE
    return 0.1 if name == 'force_bias' else WITHIN * value


def table(found: Sequence[Identified]) -> str:
    """Return a Markdown table of what all seeds found: a row a parameter."""
    rows = [['parameter', 'true', 'median', 'median error', 'allowed', 'within, of told', 'told',
             'in its interval']]
    for name, value in truth().items():
        told = [each for each in found if name in each.intervals]
        if told:
            values = np.array([each.values[name] for each in told])
            errors = np.abs(values - value)
            covered = sum(each.intervals[name][0] <= value <= each.intervals[name][1]
                          for each in told)
            rows.append([name, f'{value:g}', f'{np.median(values):.4g}',
                         f'{np.median(errors):.2g}', f'{allowed(name, value):.2g}',
                         f'{np.sum(errors <= allowed(name, value))} of {len(told)}',
                         f'{len(told)} of {len(found)}', f'{covered} of {len(told)}'])
    return aligned(rows, names=1)


def swing_up(seed: int, known: dict[str, Any]) -> Metrics:
    """Let the mpc swing the rig up with what it is told."""
    plant = plants.plant(rig(seed))
    return measure(simulate(plant, controllers.controller({**known, 'seed': seed}), SWING_UP))


def comparison(found: Identified, seeds: range, jobs: int) -> str:
    """Return a Markdown table of swing-ups with what was found and with what the mpc learns."""
    runs = Parallel(jobs)(delayed(swing_up)(seed, known) for known in ({}, found.values)
                          for seed in seeds)
    alone, with_file = runs[:len(seeds)], runs[len(seeds):]
    rows = [['the mpc', 'held', 'settling time, median [s]']]
    for name, metrics in (('learns alone', alone), ('with what was found', with_file)):
        times = [each.settling_time for each in metrics if each.success]
        rows.append([name, f'{len(times)} of {len(metrics)}', f'{np.median(times):.2f}'])
    times = [np.array([each.settling_time if each.success else np.nan for each in metrics])
             for metrics in (with_file, alone)]
    of = paired(*times)
    return (f'{aligned(rows, names=1)}\n\nsettling time with what was found less that alone, over '
            f'{of.pairs} seeds where both held: median {of.median:+.3f} s '
            f'({of.low:+.3f} to {of.high:+.3f}), sign test p = {of.p:.2g}')


def main() -> None:
    """Identify, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seeds', type=int, default=10, help='of each motion')
    parser.add_argument('--motions', nargs='+', choices=MOTIONS, default=list(MOTIONS))
    parser.add_argument('--compare', type=int, default=100, help='swing-ups to compare')
    parser.add_argument('--jobs', type=int, default=2)
    arguments = parser.parse_args()
    for motion in arguments.motions:
        found = Parallel(arguments.jobs)(
            delayed(identified)(seed, motion) for seed in range(arguments.seeds))
        print(f'{MOTIONS[motion]}, {DURATION:g} s, {arguments.seeds} seeds:\n\n{table(found)}\n',
              flush=True)
    if arguments.compare:
        print(comparison(identified(0, 'pushed'), range(arguments.compare), arguments.jobs))


if __name__ == '__main__':
    main()
