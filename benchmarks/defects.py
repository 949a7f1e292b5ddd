# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Seeded defects: which of the mistakes that one makes the tests see.

    python benchmarks/defects.py [--only TEXT] [--out FILE.csv]

Each defect is put into a copy of the checkout, where the tests that should see it first are run up
to their first failure; a defect is killed where one fails, and survives where none does. They were
chosen for what goes wrong in such programs, not for what the tests look at. One whose text is not
there exactly once is not run: it is to be anchored anew, by its description. Needs what the tests
need (`make shell`); all take a quarter of an hour on two cores.
"""

import argparse
from collections.abc import Iterator, Sequence
import contextlib
import csv
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

TOP = Path(__file__).parents[1]
PATIENCE = 900.0   # [s] for the tests of one defect; one that hangs is seen, too
KILLED, SURVIVED, HUNG = 'killed', 'survived', 'hung'
NOT_RUN, MOVED = 'not run', 'to be anchored anew'


class Defect(NamedTuple):
    """A mistake: in which file of the package, what is there once and what is instead."""

    what: str
    file: str
    right: str
    wrong: str
    tests: tuple[str, ...]   # paths in test/ that should see it first


class Result(NamedTuple):
    """What the tests made of a defect."""

    what: str
    file: str
    outcome: str
    seconds: float


def defect(what: str, file: str, right: str, wrong: str, tests: str) -> Defect:
    """Return a defect whose tests are words."""
    return Defect(what, file, right, wrong, tuple(tests.split()))


DEFECTS = [
    # pendulum
    defect('Coriolis terms of two links have the wrong sign', 'pendulum/equations.py',
           '(s[i] * c[j] - c[i] * s[j])', '(c[i] * s[j] - s[i] * c[j])', 'pendulum'),
    defect('joint friction acts on both links the same way', 'pendulum/equations.py',
           'r[i] = r[i] + torque', 'r[i] = r[i] - torque', 'pendulum'),
    defect('the third stage of RK4 starts from the first slope', 'pendulum/integrators.py',
           'k_3 = f(moved(x, h / 2, k_2), u)', 'k_3 = f(moved(x, h / 2, k_1), u)', 'pendulum'),
    defect('relative angles are not summed', 'pendulum/state.py',
           'np.cumsum(relative[..., 1:], axis=-1)', 'relative[..., 1:]', 'pendulum'),
    defect('an offset is taken off after the sign', 'pendulum/sensors.py',
           'signs * (q - self.joint_offsets)', 'signs * q - self.joint_offsets', 'pendulum'),
    defect('the velocities of a sensor that counts down keep their sign', 'pendulum/sensors.py',
           'self.joint_offsets), signs * v', 'self.joint_offsets), v', 'pendulum'),
    defect('a command acts before it was sent, not a delay later', 'pendulum/drive.py',
           'ends_acting = ends[k] + drive.delay', 'ends_acting = ends[k] - drive.delay',
           'pendulum control'),
    defect('the bias of the drive has the wrong sign', 'pendulum/drive.py',
           'drive.gain * mean + drive.bias', 'drive.gain * mean - drive.bias',
           'pendulum estimators'),
    # problem
    defect('the warm start is shifted a step too far', 'problem/plan.py',
           't, weight = int(place), place - int(place)',
           't, weight = int(place) + 1, place - int(place)', 'problem control'),
    defect('gains are not shifted with the plan', 'problem/plan.py',
           'self.U[t:], self.K[t:]', 'self.U[t:], self.K[:len(self.K) - t]', 'problem control'),
    defect('the command is not clipped', 'problem/plan.py',
           'return min(max(force, -limit), limit) if math.isfinite(force) else 0.0',
           'return force if math.isfinite(force) else 0.0', 'problem control'),
    defect('the bias is added to the command', 'problem/plan.py',
           '(float(self.U[0]) - self.drive.bias)', '(float(self.U[0]) + self.drive.bias)',
           'problem control simulation'),
    # solvers
    defect('V_xx lacks a term of the policy', 'solvers/riccati.py',
           'Q_zz[i, j] + gains[i] * g + Q_ux[i] * K_j', 'Q_zz[i, j] + gains[i] * g', 'solvers'),
    defect('a force on its bound follows the state', 'solvers/riccati.py',
           'follows = change == best', 'follows = True', 'solvers'),
    defect('of the gaps the wrong share is closed', 'solvers/riccati.py',
           '-= (1 - alpha) * gaps[t, i]', '-= alpha * gaps[t, i]', 'solvers control'),
    defect('samples are weighted by the temperature upside down', 'solvers/mppi.py',
           '(lowest - J) / F(temperature)', '(lowest - J) * F(temperature)', 'solvers'),
    defect('the deadline of MPPI is stale', 'solvers/mppi.py',
           'if time.perf_counter() > deadline:', 'if time.perf_counter() > deadline + 1.0:',
           'solvers'),
    defect('the cheapest sample is no candidate', 'solvers/mppi.py',
           'return found if parameters.elite else found[:1]', 'return found[:1]', 'solvers'),
    defect('both numbers of a pair of noises land in one place', 'solvers/noise.py',
           'begin = first + j * LANES', 'begin = first', 'solvers'),
    # control
    defect('commands end by the clock, not after the state', 'control/commands.py',
           'np.concatenate((times[place:] - t,', 'np.concatenate((times[place:],',
           'control'),
    defect('the last command is the one that begins now', 'control/commands.py',
           'self.times.searchsorted(t) - 1', "self.times.searchsorted(t, 'right') - 1",
           'control'),
    defect('a frozen state is noticed one state late', 'control/message_filter.py',
           'if count < least:', 'if count <= least:', 'control'),
    defect('the message filter remembers a run before a reset', 'control/message_filter.py',
           'self.past.clear()', 'pass', 'control'),
    defect('the estimator is not reset with the controller', 'control/observer.py',
           '        self.estimator.reset()\n', '', 'control'),
    defect('a rejected state counts as one that is believed', 'control/supervisor.py',
           'if not belief.rejection and', 'if', 'control'),
    defect('a plan from before it was disabled is followed', 'control/receding_horizon.py',
           '        if changes:\n            self.planner.discard()\n', '', 'control'),
    defect('the time that the drive delays is not predicted', 'control/commands.py',
           'acts_at + drive.delay)', 'acts_at)', 'control simulation'),
    defect('the state stays on its turn, the warm start does not', 'control/starts.py',
           'solver.solve(x_0 - back, replace', 'solver.solve(x_0, replace', 'control'),
    defect('the brake ignores how fast the force may change', 'control/supervisor.py',
           'max(bounds.low, u - change), min(bounds.high, u + change)',
           'bounds.low, bounds.high', 'control'),
    defect('the speed of a link is limited, not that of the cart', 'control/supervisor.py',
           '(X.shape[1] // 2, limits.cart_speed_limit',
           '(X.shape[1] // 2 + 1, limits.cart_speed_limit', 'control'),
    # estimators
    defect('a new start keeps the noises learned before', 'estimators/kalman.py',
           'self.in_a_row = 0\n        self.take_noises_as_given()\n        unm',
           'self.in_a_row = 0\n        unm', 'estimators'),
    defect('springs are looked for in what comes alone', 'estimators/kalman.py',
           'for measured in later:', 'for measured in later[-1:]:', 'estimators'),
    defect('whatever is missing is taken for springs', 'estimators/kalman.py',
           'errors < BETTER * without', 'errors < math.inf', 'estimators'),
    defect('a plan may leave springs wound up', 'control/planner.py',
           'problem.on_turn_of(plan.X[-1]) is None, ', '', 'control'),
    defect('refusals in a row are counted over accepted states', 'estimators/kalman.py',
           '                self.in_a_row = 0\n', '', 'estimators'),
    defect('the Jacobian of the filter is transposed', 'estimators/gaussian.py',
           '(ends_of[j, i] - mean[i]) / differences', '(ends_of[i, j] - mean[j]) / differences',
           'estimators'),
    defect('the error of the time has the wrong sign', 'estimators/gaussian.py',
           'mean[i] - rate[i] * mean[k]', 'mean[i] + rate[i] * mean[k]', 'estimators'),
    # simulation
    defect('an end stop holds the cart, but not its speed', 'simulation/engines.py',
           'if side * x[cart] > 0:', 'if side * x[cart] > math.inf:', 'simulation'),
    defect('the actuator does not saturate', 'simulation/plant.py',
           'target = min(max(self.commands.force + self.noise, -largest), largest)',
           'target = self.commands.force + self.noise', 'simulation'),
    defect('the shafts of encoders stay where they were at a reset', 'simulation/plant.py',
           'self.shafts: Array | None = None ', "self.shafts = getattr(self, 'shafts', None) ",
           'simulation'),
    defect('a late command is obeyed after a newer one', 'simulation/plant.py',
           'self.coming[-1].acts_at >= acts_at:', 'self.coming[-1].acts_at >= math.inf:',
           'simulation'),
    defect('a measurement is a period late', 'simulation/plant.py',
           'ends / rate - delay)', '(ends + 1) / rate - delay)', 'simulation'),
    defect('a command never expires', 'simulation/plant.py',
           'self.expires, self.expired = acts_at + lasts, False',
           'self.expires, self.expired = math.inf, False', 'simulation'),
    # nodes
    defect('a push acts in every period after it', 'runtime/plant.py',
           'push, self.push = self.push, 0.0', 'push = self.push', 'runtime'),
    defect('a force that is no number is obeyed', 'runtime/plant.py',
           'if not math.isfinite(force):', 'if math.isinf(force):', 'runtime'),
    defect('the stream of commands does not end with zero', 'runtime/mpc.py',
           'if self.forces:\n            self.command(0.0)', 'if self.forces < 0:\n'
           '            self.command(0.0)', 'runtime'),
    defect('a lost state is counted twice by the mpc', 'runtime/schedule.py',
           'self.missed_total += steps - 1 if', 'self.missed_total += 2 * (steps - 1) if',
           'runtime'),
    defect('a figure of the diagnostics has another name', 'messages/ticks.py',
           'found[name] = value',
           "found[name.replace('_total', '_ticks')] = value",
           'runtime tools/test_analyse.py'),
    defect('a deadline is counted from the state, not from the tick', 'runtime/schedule.py',
           ' began + min(', ' t + min(', 'runtime'),
    defect('the watchdog barks after microseconds', 'nodes/mpc.py',
           'round(after * 1e9)', 'round(after * 1e3)', 'nodes/test_mpc.py'),
    defect('a tick is given more than is left', 'runtime/timing.py',
           'min(longest, max(left - SLACK', 'max(longest, max(left - SLACK', 'runtime'),
    # messages
    defect('nanoseconds are read as microseconds', 'messages/fields.py',
           'return nanoseconds(stamp) / BILLION', 'return stamp.sec + stamp.nanosec * 1e-6',
           'messages nodes/test_messages.py'),
    defect('joints are taken in the order of the message', 'messages/fields.py',
           'order = [names.index(joint) for joint in wanted]', 'order = list(range(len(wanted)))',
           'messages'),
    defect('a state that was lost is not counted', 'messages/states.py',
           'self.number += lost + 1', 'self.number += 1', 'messages nodes/test_sequences.py'),
    # bags
    defect('receive and publication time are exchanged', 'bags/writer.py',
           'received, data, sent, sequence)', 'sent, data, received, sequence)', 'bags'),
    defect('a bag ends without its index', 'bags/writer.py',
           '            self._writer.finish()\n', '', 'bags'),
    defect('the forces of a run are off by a period', 'bags/episodes.py',
           '[sample.force for sample in samples[1:]]', '[sample.force for sample in samples[:-1]]',
           'bags/test_episodes.py'),
    defect('the end of a bag is its first message', 'bags/metadata.py',
           'last=max(self.last, received)', 'last=min(self.last, received)', 'bags'),
    # rerun
    defect('a recorded reset is not repeated', 'rerun/answers.py',
           'if tick.reset:', 'if tick.reset and tick.stopping:', 'rerun'),
    defect('what led to a tick is a tick short', 'rerun/ticks.py',
           'each.number <= tick.number]', 'each.number < tick.number]', 'rerun'),
    # identification and learning
    defect('an interval takes the loss for a square', 'identification/fit.py',
           'weights ** 3 * J', 'weights * J', 'identification'),
    defect('what is found without a segment is counted with it', 'identification/fit.py',
           'inverse((whole - H)[:', 'inverse((whole + 0 * H)[:', 'identification'),
    defect('the command before a segment is left out', 'identification/segments.py',
           "np.searchsorted(sent, t - HISTORY, 'right') - 1",
           "np.searchsorted(sent, t - HISTORY, 'right')", 'identification'),
    defect('a learned potential pulls upward', 'dynamics/structured.py',
           '0.5 * dot(speeds, momenta) - down', '0.5 * dot(speeds, momenta) + down',
           'dynamics learning/test_learner.py'),
    defect('transitions on end all last as long as the first', 'learning/regression.py',
           'U[m:m + 1], x, h[m])', 'U[m:m + 1], x, h[k])', 'learning/test_regression.py'),
    # evaluation
    defect('a run has settled while it is still outside', 'evaluation/metrics.py',
           'first = int(outside[-1]) + 1 if', 'first = int(outside[-1]) if',
           'evaluation/test_metrics.py'),
    defect('a cart that stays at an end stop strikes again and again', 'evaluation/metrics.py',
           'np.diff(at_stop.astype(int), prepend=0) > 0', 'at_stop.astype(int) > 0',
           'evaluation/test_metrics.py'),
    # parameters
    defect('the largest value of a parameter is refused', 'parameters/__init__.py',
           "<= element <= about['maximum']", "<= element < about['maximum']",
           'parameters test_declarations.py'),
    defect('a list of a wrong length is taken', 'parameters/__init__.py',
           'if sizes and len(elements) not in sizes:', 'if sizes and not elements:',
           'parameters test_declarations.py'),
    # console
    defect('a hand that is gone pulls on', 'console/pulls.py',
           'if now < until}', 'if until}', 'console/test_pulls.py'),
    defect('a page of any port is ours', 'console/access.py',
           'if port != self.port or', 'if not port or', 'console/test_access.py'),
    defect('the lead is that over the dearest start', 'runtime/report.py',
           'costs[1] - costs[0]', 'costs[-1] - costs[0]', 'runtime')]


class MovedError(Exception):
    """The text of a defect is not there, or more than once."""


@contextlib.contextmanager
def applied(one: Defect, checkout: Path) -> Iterator[None]:
    """Put a defect into a checkout for a while; raises MovedError."""
    file = checkout / 'dp_swing_ros' / one.file
    text = file.read_text() if file.exists() else ''
    if text.count(one.right) != 1:
        raise MovedError(f'{one.file} has {text.count(one.right)} times {one.right!r}')
    file.write_text(text.replace(one.right, one.wrong))
    try:
        yield
    finally:
        file.write_text(text)


def copied(to: Path) -> Path:
    """Return a copy of the checkout as it is, without what git ignores."""
    names = subprocess.run(['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
                           cwd=TOP, check=True, capture_output=True, text=True).stdout
    for name in filter(None, names.split('\0')):
        if (TOP / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(TOP / name, to / name)
    return to


def with_kernels(to: Path) -> Path:
    """Return a cache folder with the kernels that are compiled already."""
    cache = Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / 'dp_swing_ros'
    if cache.exists():
        shutil.copytree(cache, to / cache.name)
    return to


def tested(checkout: Path, cache: Path, tests: Sequence[str]) -> str:
    """
    Return what tests make of a checkout, with whose package also nodes are started.

    No bytecode is written: of a file that is changed and changed back it may be stale.
    """
    path = os.pathsep.join(filter(None, (str(checkout), os.environ.get('PYTHONPATH', ''))))
    process = subprocess.Popen(
        [sys.executable, '-m', 'pytest', '-x', '-q', '-p', 'no:cacheprovider',
         *(f'test/{name}' for name in tests)], cwd=checkout, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env={**os.environ, 'PYTHONPATH': path, 'PYTHONDONTWRITEBYTECODE': '1',
             'XDG_CACHE_HOME': str(cache)})
    try:
        # 1: a test failed; 2: none could be collected, for what they import breaks
        return {0: SURVIVED, 1: KILLED, 2: KILLED}.get(process.wait(PATIENCE), NOT_RUN)
    except subprocess.TimeoutExpired:
        return HUNG
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def main() -> None:
    """Run the tests of some defects, print what came of each, and write that as a table."""
    parser = argparse.ArgumentParser(description=__doc__.strip().partition('\n')[0])
    parser.add_argument('--only', default='', help='those with this in description or file')
    parser.add_argument('--out', type=Path, help='a CSV file')
    parser.add_argument('--sound', action='store_true',
                        help='run the same tests without the defects: all are to survive')
    given = parser.parse_args()
    chosen = [each for each in DEFECTS if given.only in f'{each.what} {each.file}']
    results = list[Result]()
    with tempfile.TemporaryDirectory() as folder:
        cache = with_kernels(Path(folder, 'cache'))
        checkout = copied(Path(folder, 'checkout'))
        for each in chosen:
            began = time.monotonic()
            try:
                with contextlib.nullcontext() if given.sound else applied(each, checkout):
                    outcome = tested(checkout, cache, each.tests)
            except MovedError as error:
                outcome = MOVED
                print(error, file=sys.stderr)
            results.append(Result(each.what, each.file, outcome, time.monotonic() - began))
            print(f'{outcome:10} {results[-1].seconds:6.0f} s  {each.file:28} {each.what}',
                  flush=True)
    print(', '.join(f'{sum(each.outcome == outcome for each in results)} {outcome}'
                    for outcome in (KILLED, HUNG, SURVIVED, NOT_RUN, MOVED)))
    if given.out:
        with given.out.open('w', newline='') as file:
            writer = csv.writer(file)
            writer.writerow(Result._fields)
            writer.writerows(each._replace(seconds=round(each.seconds, 1)) for each in results)
    sys.exit(any(each.outcome in (NOT_RUN, MOVED) for each in results))


if __name__ == '__main__':
    main()
