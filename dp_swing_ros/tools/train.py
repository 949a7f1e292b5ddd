# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros train BAG... -o MODEL`: learned dynamics from recorded motion."""

import argparse
from collections.abc import Sequence
import dataclasses
from pathlib import Path
import time

import numpy as np

from dp_swing_ros import figures
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.dynamics.structured import Structured
from dp_swing_ros.errors import UserError
from dp_swing_ros.identification.given_cart import on_given_cart
from dp_swing_ros.identification.recorded import recorded_of_one
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.models import learned, parted
from dp_swing_ros.learning.quality import AHEAD, Errors, errors, rms
from dp_swing_ros.learning.recorded import stretches
from dp_swing_ros.learning.regression import LONGEST_STEP
from dp_swing_ros.pendulum.equations import Pendulum, scale_of
from dp_swing_ros.pendulum.parameters import DIRECT
from dp_swing_ros.pendulum.state import joints, LINKS
from dp_swing_ros.tables import aligned
from dp_swing_ros.tools.command_lines import (
    bag_parser, beside, execute, MOTION, OK, print_incomplete, progress, within)


def main(argv: Sequence[str] | None = None) -> int:
    """Train on the bags that the command line names; return the exit code."""
    parser = bag_parser(
        'train', f'Learn the dynamics of what moved in bags ({MOTION}), '
        'as a model that an mpc can plan with. A fifth of the motion is held out, to judge by: '
        'the errors of predictions, beside those of the equations with the parameters of the '
        'recorded mpc, and a picture of them.',
        nargs='+', help=f'folder of a bag with {MOTION}, or its .mcap file; '
                        'several are of one pendulum')
    parser.epilog = (
        f'examples: {parser.prog} my_bag -o model.json; {parser.prog} bag1 bag2 -o model.json; '
        'then: ros2 run dp_swing_ros mpc --ros-args -p dynamics:=learned -p model:=model.json')
    parser.add_argument('-o', '--output', type=Path, metavar='MODEL',
                        help='file to write, its picture beside it (default: '
                             'BAG_structured.json, beside the bag)')
    parser.add_argument('--seed', type=within(int, 0), default=0,
                        help='of what is held out (default: 0)')
    parser.add_argument('--links', type=int, choices=LINKS,
                        help='number of links (default: what the bag says)')
    return execute(parser, _train, argv)


def _train(arguments: argparse.Namespace) -> int:
    bags = [Bag(path, arguments.partial, arguments.namespace, arguments.node)
            for path in arguments.bag]
    found, began = recorded_of_one(bags, arguments.links), time.monotonic()
    # dynamics that are learned make up for gain and bias of the drive
    physical, drive = found[-1].estimated
    acting = drive
    if physical.is_driven:   # nothing but how the cart moves acts on the links
        acting, found = DIRECT, [
            each._replace(motion=on_given_cart(each.motion, physical.masses[0]))
            for each in found]
    # an estimator has seen what is held out: its parameters are no judge of what is learned
    scale = scale_of(found[0].physical)
    gain = 1.0 if physical.is_driven else found[0].drive.gain
    known, told = (by_commands(Pendulum.of(each, scale=scale), gain)
                   for each in (physical, found[0].physical))
    parts = parted([stretch for each in found
                    for stretch in stretches(each.motion, each.V, acting, scale)],
                   arguments.seed, scale)
    step = scale.sized(LONGEST_STEP, 's')
    seen, held_out = map(Experience.joined, parts)
    print(f'{seen.duration:.1f} s to learn from, {held_out.duration:.1f} s held out', flush=True)
    curve = list[tuple[float, float]]()
    with progress(desc='rounds', unit='') as bar:
        def on_round(dynamics: Structured) -> None:
            curve.append((rms(dynamics, seen, step), rms(dynamics, held_out, step)))
            bar.set_postfix_str(f'off by {curve[-1][0]:.3g}, held out {curve[-1][1]:.3g}')
            bar.update()
        try:
            model = learned(known, parts, on_round, drive, scale)
        except (FloatingPointError, np.linalg.LinAlgError) as error:
            raise UserError(f'nothing can be learned from these bags: {error}; record a minute '
                            'that swings, is held and pushed') from None
    own, analytic = (errors(dynamics, parts.held_out, step)
                     for dynamics in (model.dynamics, told))
    model = dataclasses.replace(model, about={
        **model.about, 'seed': arguments.seed, 'bags': [path.name for path in arguments.bag],
        'errors': own.as_figures, 'errors of the equations': analytic.as_figures})
    has_springs = any((*known.stiffness, *known.preload, *told.stiffness, *told.preload))
    print(table(own, analytic), *remarks(own, analytic, has_springs), sep='\n')
    print(f'drive: {1e3 * drive.delay:.1f} ms of delay, {1e3 * drive.time_constant:.1f} ms of lag',
          *dict.fromkeys(each.times for each in found), sep='\n')
    print_incomplete(bags)
    output = arguments.output or Path(f'{beside(arguments.bag[0], "structured")}.json')
    print(*write(model, curve, own, analytic, output), sep='\n')
    print(f'{time.monotonic() - began:.1f} s of computing')
    return OK


def by_commands(p: Pendulum, gain: float) -> Pendulum:
    """Return the pendulum that commands move as forces of `gain` newtons each move this one."""
    def share(values: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(value / gain for value in values)
    return p._replace(m=p.m / gain, a=share(p.a), b=tuple(map(share, p.b)),
                      friction=share(p.friction), dry=share(p.dry), stiffness=share(p.stiffness),
                      preload=share(p.preload))


def table(own: Errors, analytic: Errors) -> str:
    """Return a Markdown table of what predictions miss of what was held out."""
    n = len(own.speeds) - 1
    units = ['m/s', *['rad/s'] * n]
    rows = [['held out', 'learned', 'equations', 'unit'],
            *([f'speed of {joint}, one step, RMS', *map(_number, pair), unit]
              for joint, unit, *pair in zip(joints(n), units, own.speeds, analytic.speeds))]
    if len(own.ahead):
        rows += [[f'an angle, {AHEAD} steps, {name}',
                  *(_number(np.quantile(each.ahead, q)) for each in (own, analytic)), 'rad']
                 for name, q in (('median', 0.5), ('95 %', 0.95))]
    return aligned(rows, names=1)


def _number(value: float) -> str:
    return f'{value:.3g}'


def remarks(own: Errors, analytic: Errors, has_springs: bool) -> list[str]:
    """Return in words what is to be known before the model is used."""
    found = []
    if has_springs:
        found.append('warning: the joints have springs, of which what is learned knows nothing')
    if np.all(own.speeds > analytic.speeds):
        found.append('warning: the equations with the parameters of the recorded mpc predict '
                     'better; plan with them, or record more')
    if not len(own.ahead):
        found.append(f'no stretch that was held out has {AHEAD} transitions; record longer')
    return found


def write(model: LearnedModel, curve: Sequence[tuple[float, float]], own: Errors,
          analytic: Errors, output: Path) -> list[Path]:
    """Write model and picture; return their files."""
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(model.to_text(), encoding='utf-8')
    picture = output.with_suffix('.png')
    figures.training(curve, own, analytic, model.about['seconds']).savefig(picture)
    return [output, picture]
