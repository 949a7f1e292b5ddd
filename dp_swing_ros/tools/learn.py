# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros learn`: from random forces to a pendulum that is held."""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import math
from pathlib import Path
import time
from typing import Any, TYPE_CHECKING

from tqdm import tqdm

from dp_swing_ros import declarations, environment, figures
from dp_swing_ros.control import controllers
from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.errors import UserError
from dp_swing_ros.learning.learner import FIRST, Learner
from dp_swing_ros.learning.trials import OUT, Trial, trials
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.parameters import DRIVEN, FORCE, VOLTAGE
from dp_swing_ros.simulation import plants
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tools.command_lines import (
    dated, ELSE, execute, FAILED, given, new_folder, OK, program, within)
from dp_swing_ros.tools.processes import located

if TYPE_CHECKING:
    from dp_swing_ros.tools.live_learning import LiveLearner

MODEL = 'model.json'
DURATIONS = {'first': FIRST, 'total': 60.0, 'hold': 2.0}   # [s] scaled, if none are given

Show = Callable[[float, float], object]   # of the experience so far [s], and the deviation [rad]


def main(argv: Sequence[str] | None = None) -> int:
    """Learn as the command line asks; return the exit code."""
    parser = argparse.ArgumentParser(
        prog=program('learn'),
        description='Swing up and hold a simulated pendulum of which the number of links and '
                    'the limits of force and track are known, and its size, about: with random '
                    'forces at first, then '
                    'by planning with what was learned so far, from every transition. Leaves the '
                    'learned model, which an mpc can plan with, and a picture; the exit code is 0 '
                    'if the pendulum was held in the end.',
        epilog=f'examples: {program("learn")} --solver mppi; then: ros2 run dp_swing_ros mpc '
               '--ros-args -p dynamics:=learned -p model:=DIR/model.json')
    parser.add_argument('--solver', choices=list(SOLVERS),
                        help=ELSE.format('ilqr'))
    parser.add_argument('--params', type=Path, metavar='FILE', action='append', default=[],
                        help='YAML file with parameters of the plant, bodies and noises too, and '
                             'of an mpc, of whose own bodies the size alone matters')
    breaks = parser.add_mutually_exclusive_group()
    breaks.add_argument('--trial', type=within(float, 1.0), metavar='SECONDS',
                        help='of a trial, after which the pendulum hangs again (default: it goes '
                             'on without a break)')
    breaks.add_argument('--live', action='store_true',
                        help='what moves is no simulation but a plant that runs, ours or any; its '
                             'forces come from this process and then from an mpc that it starts')
    default = '(default: {:g}, scaled with the bodies of the mpc)'
    for name, least, text in (
            ('first', 0.5, 'of random forces'), ('total', 1.0, 'of experience, at most'),
            ('hold', 0.5, f'within {OUT:g} rad, until it counts as held')):
        parser.add_argument(f'--{name}', type=within(float, least), metavar='SECONDS',
                            help=f'{text} {default.format(DURATIONS[name])}')
    parser.add_argument('--seed', type=within(int, 0),
                        help=f'of noises, random forces and solver {ELSE.format(0)}')
    parser.add_argument('--output', '-o', type=Path, metavar='DIR',
                        help='folder to make (default: runs/learn_SOLVER_TIME)')
    return execute(parser, _learn, argv)


def _learn(arguments: argparse.Namespace) -> int:
    if arguments.live:   # with an mpc that takes what is for its name
        located(arguments.params, {})
    values = declarations.read(arguments.params)
    if (drive := values['mpc'].get('drive', FORCE)) in DRIVEN:
        raise ParameterError(
            f'parameter drive is {drive!r}; expected {FORCE} or {VOLTAGE}: what is learned are '
            'forces. Record a run by an mpc with this drive, and let train learn from the bag')
    plant = {**values['plant'], **given(arguments, 'seed')}
    mpc = {**values['mpc'], **given(arguments, 'solver', 'seed')}
    controller = controllers.controller(mpc)   # refused before a folder is made
    solver, scale = controller.parameters.solver, controller.nominal.scale
    vars(arguments).update({name: scale.sized(value, 's') for name, value in DURATIONS.items()
                            if getattr(arguments, name) is None})
    plants.plant(plant)
    if arguments.total <= arguments.first:
        raise UserError(f'--total is {arguments.total:g} s, and --first, of random forces alone, '
                        f'{arguments.first:g} s; expected more time in all')
    folder = new_folder(arguments.output or Path('runs', dated(f'learn_{solver}')))
    print(f'{solver}: {arguments.first:g} s of random forces first -> {folder}',
          flush=True)
    began = time.monotonic()
    with tqdm(total=arguments.total, leave=False, disable=None,
              bar_format='{n:5.1f}/{total:g} s |{bar}| {desc}') as bar:
        def show(experience: float, off: float) -> None:
            bar.n = experience
            bar.set_description_str(f'{off:.2f} rad off')
        if arguments.live:
            model, done = _live(arguments, mpc, folder, show)
        else:
            model, done = _simulated(arguments, mpc, plant, folder, show)
    held = bool(done) and done[-1].held >= arguments.hold
    if model is not None:
        print(*write(model, done, arguments.first, folder), sep='\n')
    print(f'{"held" if held else "not held"} after '
          f'{done[-1].experience[-1] if done else 0.0:.1f} s of experience, '
          f'{time.monotonic() - began:.1f} s of computing')
    return OK if held else FAILED


def _simulated(arguments: argparse.Namespace, mpc: Mapping[str, Any], plant: Mapping[str, Any],
               folder: Path, show: Show) -> tuple[LearnedModel | None, list[Trial]]:
    learner, done = Learner(mpc, arguments.first), list[Trial]()
    with _kept(learner, folder):
        for trial in trials(learner, plant, arguments.trial or math.inf, arguments.total,
                            arguments.hold, show):
            done.append(trial)
            tqdm.write(line(trial))
    return learner.model, done


def _live(arguments: argparse.Namespace, mpc: Mapping[str, Any], folder: Path,
          show: Show) -> tuple[LearnedModel | None, list[Trial]]:
    if error := environment.misused():
        raise UserError(error)
    # ROS is slow to load, and the simulation does without
    from dp_swing_ros.tools.live_learning import learning, LiveLearner
    from dp_swing_ros.tools.tool_node import tool_node
    with tool_node('learn') as node:
        learner = LiveLearner(node, mpc)
        with _kept(learner, folder):
            trial = learning(learner, arguments, folder, show)
    tqdm.write(line(trial))
    return learner.model, [trial]


@contextmanager
def _kept(learner: 'Learner | LiveLearner', folder: Path) -> Iterator[None]:
    """Keep what was learned until something ends it early."""
    try:
        yield
    except (KeyboardInterrupt, UserError) as error:
        if learner.model is None:
            raise
        file = folder / MODEL
        file.write_text(learner.model.to_text(), encoding='utf-8')
        words = f'what was learned until then is in {file}'
        raise type(error)(f'{error}; {words}' if str(error) else words) from None


def line(trial: Trial) -> str:
    """Return what came of a trial."""
    noise = ', '.join(f'{each:.3g}' for each in trial.noise)
    return (f'trial {trial.number}: {trial.experience[-1]:.1f} s of experience, '
            f'{trial.deviation[-1]:.3f} rad off at the end, within {OUT:g} rad for '
            f'{trial.held:.1f} s; speeds a period ahead are off by {noise or "?"} m/s, rad/s')


def write(model: LearnedModel, done: Sequence[Trial], first: float, folder: Path) -> list[Path]:
    """Write model and picture; return their files."""
    files = [folder / MODEL, folder / 'learning.png']
    files[0].write_text(model.to_text(), encoding='utf-8')
    figures.learning(done, first).savefig(files[1])
    return files
