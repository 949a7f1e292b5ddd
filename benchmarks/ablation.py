# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What each part of the controller is worth: the runs with all parts but one.

A part is what switches something around a solver or in it: a start, a gate, an adaptation, a
compensation, an unknown of the filter, a term of the cost. Most are switched by a parameter, the
others by what stands in their place in the code while such a controller runs.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
import contextlib
from dataclasses import dataclass
import math
from typing import Any, NamedTuple

import campaigns
from campaigns import CERTAIN
import numpy as np

from dp_swing_ros.control import message_filter, observer, starts
from dp_swing_ros.control.commands import SentCommands
from dp_swing_ros.control.message_filter import MessageFilter
from dp_swing_ros.control.observer import Belief
from dp_swing_ros.control.planner import Planner
from dp_swing_ros.control.starts import Starts
from dp_swing_ros.control.supervisor import Supervisor
from dp_swing_ros.estimators import kalman
from dp_swing_ros.estimators.kalman import ExtendedKalmanFilter
from dp_swing_ros.evaluation.campaign.contestants import Contestant, key, parse
from dp_swing_ros.evaluation.campaign.rows import Row
from dp_swing_ros.evaluation.comparison import paired_ratio, Ratio, SAME_COST, sign_test
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.problem.problem import Problem, regulator_rollout, Rollout
from dp_swing_ros.simulation.closed_loop import Controller
from dp_swing_ros.tables import compact

SOLVERS = ('ilqr', 'mppi')     # around DDP stands what stands around iLQR
SEEDS = range(1000, 1014)     # held out: nothing was chosen on them
FEW = range(1000, 1010)       # of what a part is meant for
SHOWN = 0.01                  # p of a difference in what is held
ONE_A_STEP = 'one solve a step, where states come faster (one for each instead)'


class Trial(NamedTuple):
    """Cases of a scenario, of one sweep at one level where it has some."""

    scenario: str
    level: float | None = None
    parameter: str = ''
    seeds: range = FEW

    def __str__(self) -> str:
        """Return how the page calls it."""
        return f'`{self.scenario}`' + ('' if self.level is None else f' at {self.level:g}')

    def cases(self) -> list[Case]:
        """Return the cases."""
        found = SCENARIOS[self.scenario].cases(self.scenario, self.seeds, None, campaigns.DURATION)
        return [case for case in found if self.level is None or (
            case.level == self.level and self.parameter in ('', case.parameter))]


TRIALS = tuple(Trial(name, seeds=SEEDS) for name in ('random', 'rig_all'))
NOISE, PUSHES = Trial('position_noise', 0.01), Trial('strong_pushes', 30.0)
DELAY, LAG = Trial('unknown_delay', 0.05), Trial('rig_lag', 0.05)


class Part(NamedTuple):
    """
    What is left out: parameters of the mpc, or names in modules and classes, with what is there.

    `meant` is the trial that the part is there for, where it is none of TRIALS.
    """

    title: str
    mpc: Mapping[str, Any] = {}
    code: Mapping[tuple[Any, str], Any] = {}
    meant: Trial | None = None
    solvers: Sequence[str] = SOLVERS


def no_start(self: Starts, x_0: Array) -> None:
    """Stand for a start that is not there."""


def worthless(problem: Problem, x_0: Array) -> Rollout:
    """Follow the regulator, at a cost that no plan has."""
    return regulator_rollout(problem, x_0)._replace(J=math.inf)


def no_turns(problem: Any, x: Array) -> Array:
    """Take a state to be on the turn of the goal."""
    return np.zeros_like(x)


def unfrozen(self: MessageFilter, predictions: Any) -> str:
    """Find nothing that stands still."""
    return ''


def believed(self: MessageFilter, t: float, x: Array, *predictions: Any) -> str:
    """Ask the model that is believed alone."""
    return rejection(self, t, x, *predictions[:1])


def always(self: Planner, acts_at: float, passed: float) -> bool:
    """Solve for every state."""
    return True


def uncompensated(self: SentCommands, belief: Belief, acts_at: float) -> Array:
    """Plan from the state as it was measured."""
    return belief.x


def no_force(self: Supervisor, belief: Belief, *about: Any) -> Plan:
    """Fall back to zero force."""
    return self.zero(belief.problem, belief.problem.x_r)


def nominal_bounds(drive: Any, problem: Any) -> Any:
    """Take the force for what is commanded."""
    return problem


rejection = MessageFilter.rejection
DEFAULTS, NOTHING = 'nothing, the defaults', 'nothing shown'
PARTS = [
    Part(DEFAULTS),
    Part('all starts but the last plan', {'first_starts': 1, 'other_starts': 0}),
    Part('other starts at the first tick', {'first_starts': 1}),
    Part('other starts at later ticks', {'other_starts': 0}),
    Part('the second of them', {'other_starts': 1}, meant=Trial('tight', 6.0)),
    Part('start: the bounded LQR', code={(Starts, 'bounded_lqr'): no_start},
         meant=Trial('near_goal', seeds=range(100))),
    Part('start: the regulator', code={(Starts, 'regulator'): no_start}),
    Part('start: no force', code={(Starts, 'rest'): no_start}),
    Part('start: random forces (no force instead)', code={(Starts, 'random'): Starts.rest}),
    Part('the regulator in place of the last plan',
         code={(starts, 'regulator_rollout'): worthless}, meant=Trial('rig_joints', 0.05)),
    Part('gains of the last plan (forces are shifted)', {'warm_start': 'forces'}, meant=PUSHES),
    Part('the goal on the turn where a plan ends', code={(starts, 'turns_of'): no_turns},
         meant=Trial('uptime')),
    Part('the fallback (zero force instead)',
         code={(Supervisor, 'fallback'): no_force},
         meant=Trial('loss', 0.25, 'state_loss')),
    Part('delay compensation', code={(SentCommands, 'compensate'): uncompensated},
         meant=Trial('delay', 0.075)),
    Part('bounds of the force as estimated', code={(observer, 'driven_by'): nominal_bounds},
         meant=Trial('rig_gain')),
    Part(ONE_A_STEP, code={
        (Planner, 'is_due'): always}, meant=Trial('rig_all_fast')),
    Part('message filter: range', code={
        (message_filter, name): math.inf for name in ('TRACKS', 'LARGEST_SPEED')}),
    Part('message filter: what stands still', code={(MessageFilter, 'frozen'): unfrozen}),
    Part('message filter: the nominal model, asked too', code={
        (MessageFilter, 'rejection'): believed},
        meant=Trial('rig_bias', 5.0)),
    Part('message filter: velocities that are differences',
         code={(message_filter, 'EQUAL'): -1.0}),
    Part('estimator: all of it', {'estimator': 'none'}, meant=NOISE),
    Part('estimator: all but the state', CERTAIN),
    *(Part(f'estimator: {name}', {f'ekf.{parameter}': 0.0}, meant=meant)
      for name, parameter, meant in (
          ('masses and lengths', 'body_error', None),
          ('moments of inertia', 'inertia_error', None),
          ('where links stand balanced', 'balance_error', None),
          ('force gain', 'gain_error', Trial('rig_gain')),
          ('viscous frictions', 'friction_error', None),
          ('dry friction of the cart', 'cart_dry_friction_error', Trial('rig_cart', 4.0)),
          ('dry frictions of the joints', 'joint_dry_friction_error', Trial('rig_joints', 0.05)),
          ('delay', 'delay_error', DELAY), ('lag', 'lag_error', LAG),
          ('lasting force', 'force_bias', Trial('rig_bias', 5.0)))),
    Part('estimator: its pendulum in the plans',
         code={(ExtendedKalmanFilter, 'has_moved'): lambda self, physical: False}),
    Part('estimator: bounds of the unknowns',
         code={(kalman, 'constrain'): lambda lowest, highest, z, P: None}),
    Part('estimator: adaptation of the noises', {'ekf.adaptation': 0.0}, meant=NOISE),
    Part('estimator: memory (it never forgets)', {'ekf.memory': math.inf}),
    Part('estimator: pushes as an explanation', {'ekf.push_gate': math.inf}, meant=PUSHES),
    Part('estimator: refusal of outliers', {'ekf.gate': math.inf}, meant=PUSHES),
    Part('estimator: three refusals before it starts anew (one)',
         code={(kalman, 'REFUSALS'): 1}, meant=PUSHES),
    Part('estimator: least change that plans are told of', code={(kalman, 'MOVED'): 0.0}),
    Part('estimator: steps of 10 ms (50 ms)', code={(kalman, 'LONGEST_STEP'): 0.05}),
    Part('estimator: its narrow dry friction', code={(kalman, 'CREEP'): 0.2},
         meant=Trial('rig_joints', 0.05)),
    Part('cost: the chord of an angle', {'angle_error': 'angle'}),
    Part('cost: the LQR value at the end (1000 S)', {'terminal_cost': 'scaled'}),
    Part('cost: the margin of the track', {'track_weight': 0.0}, meant=Trial('tight', 8.0)),
    Part('several iterations a tick', {f'{name}.iterations': 1 for name in SOLVERS}),
    Part('DDP: several iterations a tick', {'ddp.iterations': 1}, solvers=('ddp',)),
    *(Part(f'MPPI: {title}', mpc, solvers=('mppi',)) for title, mpc in (
        ('samples about a policy', {'mppi.feedback': False}),
        ('the best sample as a candidate', {'mppi.elite': False}),
        ('noise correlated in time', {'mppi.noise_correlation': 0.0}),
        ('noise of several sizes (5 N)', {'mppi.smallest_noise': 5.0, 'mppi.largest_noise': 5.0}),
        ('temperature in shares of the spread', {'mppi.temperature_scale': 'fixed'}))),
    Part('all around the solver', {
        'first_starts': 1, 'other_starts': 0, 'estimator': 'none',
        'warm_start': 'forces'}),
]
BY_TITLE = {part.title: part for part in PARTS}
TEXTBOOK = 'textbook MPPI'   # of PARTS[0] and the last, with none of MPPI's own


@contextlib.contextmanager
def replaced(code: Mapping[tuple[Any, str], Any]) -> Iterator[None]:
    """Put something else in the place of names, for a while."""
    before = {(owner, name): getattr(owner, name) for owner, name in code}
    try:
        for (owner, name), value in code.items():
            setattr(owner, name, value)
        yield
    finally:
        for (owner, name), value in before.items():
            setattr(owner, name, value)


class Without:
    """A controller without a part of its code."""

    def __init__(self, code: Mapping[tuple[Any, str], Any],
                 make: Callable[[], Controller]) -> None:
        """Make the controller without it, too."""
        self.code = code
        with replaced(code):
            self.controller = make()

    def update(self, t: float, x: Array, delay: float) -> Plan:
        """Return the plan for a state; see Controller."""
        with replaced(self.code):
            return self.controller.update(t, x, delay)

    def fallback(self, begins: float) -> Plan:
        """Return the plan without one; see Controller."""
        with replaced(self.code):
            return self.controller.fallback(begins)


@dataclass(frozen=True)
class Ablated(Contestant):
    """A solver without the part of a title."""

    part: str

    def prepare(self) -> Callable[[int], Controller]:
        """Return what makes the controller for a seed; see Contestant."""
        make, code = super().prepare(), BY_TITLE[self.part].code
        return lambda seed: Without(code, lambda: make(seed))


def contestant(part: Part, name: str) -> Contestant:
    """Return a solver without a part."""
    solver = parse(campaigns.TEXTBOOK if name == TEXTBOOK else name)
    return Ablated(f'{name}, without {part.title}', solver.name, solver.plant,
                   {**solver.mpc, **part.mpc}, part.title)


class Cell(NamedTuple):
    """The episodes of a solver without a part in a trial."""

    part: Part
    name: str
    trial: Trial

    def episodes(self) -> list[tuple[Contestant, Case]]:
        """Return the episodes."""
        without = contestant(self.part, self.name)
        return [(without, case) for case in self.trial.cases()]


def cells() -> list[Cell]:
    """Return all cells of the page; of the defaults in every trial that any part is meant for."""
    found = [Cell(part, name, trial) for part in PARTS for name in part.solvers
             for trial in (*TRIALS, *([part.meant] if part.meant else []))]
    found += [Cell(PARTS[0], cell.name, cell.trial) for cell in found]
    found += [Cell(PARTS[0], name, trial) for name in campaigns.METHODS for trial in TRIALS]
    found += [Cell(part, TEXTBOOK, trial) for part in (PARTS[0], PARTS[-1]) for trial in TRIALS]
    return list({(cell.part.title, *cell[1:]): cell for cell in found}.values())


def episodes() -> list[tuple[Contestant, Case]]:
    """Return the episodes of the page."""
    return [episode for cell in cells() for episode in cell.episodes()]


class Difference(NamedTuple):
    """A cell beside the defaults: what was held, p of that difference (McNemar), costs."""

    held: int
    of_defaults: int
    cases: int
    p: float
    cost: Ratio | None     # over that of the defaults, of the cases that both held

    @property
    def verdict(self) -> int:
        """Return 1 where the runs are worse without the part, -1 where better, else 0."""
        if self.p < SHOWN:
            return 1 if self.held < self.of_defaults else -1
        if self.cost is None:
            return 0
        return (self.cost.low > SAME_COST) - (self.cost.high < 1 / SAME_COST)

    def __str__(self) -> str:
        """Return the cell of a table."""
        about = '' if self.cost is None else (
            f', {self.cost.value:.2f} ({self.cost.low:.2f}-{self.cost.high:.2f})')
        mark = {1: '**', -1: '*', 0: ''}[self.verdict]
        return f'{mark}{self.held} of {self.cases}{about}{mark}'


def difference(rows: Sequence[Row], defaults: Sequence[Row]) -> Difference:
    """Compare runs with those of the defaults, case by case."""
    held, of_defaults = (np.array([row.metrics.success for row in each])
                         for each in (rows, defaults))
    both = held & of_defaults
    costs = np.array([[row.metrics.closed_loop_cost, other.metrics.closed_loop_cost]
                      for row, other in zip(rows, defaults)])[both]
    return Difference(
        int(held.sum()), int(of_defaults.sum()), len(held),
        sign_test(int(np.sum(held & ~of_defaults)), int(np.sum(of_defaults & ~held))),
        paired_ratio(*costs.T) if both.sum() > 1 else None)


Differences = dict[tuple[str, str, Trial], Difference]


def differences(rows: Sequence[Row]) -> Differences:
    """Return every cell beside that of the defaults, by part, solver and trial."""
    found = {row.key: row for row in rows}
    of = {(cell.part.title, cell.name, cell.trial): [found[key(*one)] for one in cell.episodes()]
          for cell in cells()}
    return {place: difference(runs, of[(DEFAULTS, *place[1:])]) for place, runs in of.items()}


def verdict(part: Part, of: Differences) -> str:
    """Return in words what a part was worth."""
    found = {one.verdict for place, one in of.items() if place[0] == part.title}
    if 1 in found:
        return 'worth it, but not everywhere' if -1 in found else 'worth it'
    return 'better without' if -1 in found else NOTHING


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from the rows of all runs."""
    of = differences(rows)

    def line(part: Part, name: str) -> tuple[str, ...]:
        meant = of.get((part.title, name, part.meant)) if part.meant else None
        return (part.title, f'`{name}`', *(str(of[part.title, name, trial]) for trial in TRIALS),
                f'{part.meant}: {meant}; with it {meant.of_defaults}' if meant else '')
    verdicts: dict[str, list[str]] = {}
    for part in PARTS[1:]:
        verdicts.setdefault(verdict(part, of), []).append(part.title)
    return '\n'.join([
        '# What each part is worth\n', made,
        f'{len(rows)} episodes of {campaigns.DURATION:g} s, of `uptime` of 60 s; the rows: '
        '`results/ablation.csv.gz`. Each line leaves one part of the controller out and '
        'keeps all others; in brackets behind some, what stands in its place; those of which '
        'nothing is shown are only named below. '
        f'The trials are those of [evaluate](../evaluation.md): {", ".join(map(str, TRIALS))}, '
        f'seeds {SEEDS.start}-{SEEDS.stop - 1}, and for most parts one more that they are meant '
        f'for, seeds {FEW.start}-{FEW.stop - 1}. A cell is how many were held, and the '
        'closed-loop cost Σℓ over that of the defaults where both held: geometric mean, 95 % '
        'interval (bootstrap). Around `ddp` stands the same as around `ilqr`: of it only its own '
        'parts are left out.\n',
        f'**Bold**: worse without the part, *italic*: better. That is shown where the p of '
        f"McNemar's test of what is held is below {SHOWN:g}, or else where the whole interval "
        f'of the cost is beyond {SAME_COST:g} or below 1 / {SAME_COST:g}. Of {len(of)} cells, '
        'some are so by chance. Without an estimator no velocity is known in `rig_all`, where '
        'none is measured, so nothing can be held.\n',
        compact([('left out', 'solver', *map(str, TRIALS), 'meant for'),
                 *(line(part, name) for part in PARTS for name in solvers_of(part)
                   if part.title == DEFAULTS or verdict(part, of) != NOTHING)]) + '\n',
        *(f'{title[0].upper()}{title[1:]}: {"; ".join(parts)}.\n'
          for title, parts in verdicts.items()),
        '"Nothing shown" is no proof that a part does nothing. What guards against outliers and '
        'dead sensors meets none of them here, and where several do the same, as the other starts '
        'do, none is missed alone.\n',
        textbook(of)])


def solvers_of(part: Part) -> Sequence[str]:
    """Return whose parts are left out; of the defaults, those of all."""
    return campaigns.METHODS if part.title == DEFAULTS else part.solvers


def textbook(of: Differences) -> str:
    """Return what MPPI holds as the textbook has it, with and without what is around it."""
    alone, scaffolded = (', '.join(
        f'{one.held} of {one.cases} ({trial})' for trial in TRIALS
        for one in [of[part.title, TEXTBOOK, trial]]) for part in (PARTS[-1], PARTS[0]))
    return ('MPPI as the textbook has it (`config/textbook_mppi.yaml`: forces about forces, no '
            f'elite, no derivatives) holds, with nothing around it, {alone}; with all that is '
            f'around it here, {scaffolded}.\n')
