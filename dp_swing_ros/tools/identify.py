# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros identify BAG... -o rig.yaml`: a rig's parameters from its motion."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
import math
from pathlib import Path

import numpy as np

from dp_swing_ros import figures
from dp_swing_ros.bags.episodes import configurations_of, drive_of, sensors_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.control.controllers import MPC
from dp_swing_ros.declarations import shared
from dp_swing_ros.identification.identify import CARTS, FREE, GIVEN, Identified, identify
from dp_swing_ros.identification.recorded import Recorded, recorded_of_one
from dp_swing_ros.identification.segments import resolution
from dp_swing_ros.identification.unknowns import OF_CART
from dp_swing_ros.messages.configuration import CONTROLLER
from dp_swing_ros.parameters import checked, named, ParameterError, unknown
from dp_swing_ros.pendulum.parameters import DRIVEN, LimitParameters
from dp_swing_ros.pendulum.sensors import HANGING, SensorParameters
from dp_swing_ros.pendulum.state import joints, LINKS
from dp_swing_ros.simulation.plants import PLANT
from dp_swing_ros.tables import aligned
from dp_swing_ros.tools.command_lines import (
    bag_parser, beside, execute, MOTION, OK, print_incomplete, progress)

LIMITS = named(LimitParameters)
NOTHING = 1e-7   # a value below is none
CLEARLY = 3.0    # times what an encoder rounds off: an error beyond is not its
UNTOLD, BOUND = 'cannot be told from these bags', 'at the bound of the search'


def main(argv: Sequence[str] | None = None) -> int:
    """Identify the rig of the bags that the command line names; return the exit code."""
    parser = bag_parser(
        'identify', 'Find masses, lengths, inertias, frictions, zeros of the angles, delay, lag '
        f'and bias of a rig from recorded motion ({MOTION}), with intervals of 95 %, and write '
        'them as a parameter file for mpc and plant. Half a minute that swings, is held and '
        'pushed tells all that motion can.',
        nargs='+', help=f'folder of a bag with {MOTION}, or its .mcap file; '
                        'several are of one rig')
    parser.epilog = (
        f'examples: {parser.prog} my_bag -o rig.yaml; with what a balance and a ruler tell: '
        f'{parser.prog} bag1 bag2 -o rig.yaml --known cart_mass=1.1 link2_length=0.3; then: ros2 '
        'run dp_swing_ros mpc --ros-args --params-file rig.yaml')
    parser.add_argument('-o', '--output', type=Path, metavar='FILE',
                        help='parameter file to write, its picture beside it (default: '
                             'BAG_rig.yaml, beside the bag)')
    parser.add_argument('--known', nargs='+', action='extend', type=given, default=[],
                        metavar='NAME=VALUE',
                        help='parameters that are known; force_gain is found only where a mass '
                             'is, and the inertia factor of the last link where its length is')
    parser.add_argument('--cart', choices=CARTS,
                        help='free: moved by the commands and the links; given: as it was '
                             'recorded, clamped or driven by whatever drives it, so that no '
                             'commands are needed and the links alone are found (default: given '
                             'where the drive is acceleration or velocity, else free)')
    parser.add_argument('--links', type=int, choices=LINKS,
                        help='number of links (default: what the bag says)')
    return execute(parser, _identify, argv)


def given(text: str) -> tuple[str, float]:
    """Return name and value of NAME=VALUE."""
    name, _, value = text.partition('=')
    try:
        return name, float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f'{text[:80]!r} is not NAME=VALUE, as cart_mass=1.1') from None


def _identify(arguments: argparse.Namespace) -> int:
    bags = [Bag(path, arguments.partial, arguments.namespace, arguments.node)
            for path in arguments.bag]
    is_driven = any(drive_of(bag) in DRIVEN for bag in bags)
    cart = arguments.cart or (GIVEN if is_driven else FREE)
    if cart == FREE and is_driven:
        raise ParameterError(f'--cart {FREE}: the drive moved the cart as it was told, whatever '
                             f'its mass; expected --cart {GIVEN}')
    found = recorded_of_one(bags, arguments.links, commanded=cart == FREE)
    first, known = found[0], dict(arguments.known)
    check(known, first.physical.links, cart)
    with progress(desc='predictions', unit='') as bar:
        identified = identify([each.motion for each in found], first.physical, first.drive, known,
                              bar.update, cart)
    print(table(identified), base_table(identified), report(identified, found), sep='\n\n',
          end='\n\n')
    print_incomplete(bags)
    output = arguments.output or Path(f'{beside(arguments.bag[0], "rig")}.yaml')
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(parameter_file(
        identified, sensors_of(bags[0], first.physical.links), arguments.bag,
        told_in(bags[0])), encoding='utf-8')
    figures.identification(identified).savefig(output.with_suffix('.png'))
    print(output, output.with_suffix('.png'), sep='\n')
    return OK


def check(known: Mapping[str, float], links: int, cart: str) -> None:
    """Raise ParameterError for values that a rig with so many links cannot have."""
    if cart == GIVEN and (of_cart := [name for name in known if name in OF_CART]):
        raise ParameterError(f'{", ".join(of_cart)}: known, but with --cart given nothing depends '
                             'on it; expected values of links, joints and gravity')
    of_plant = PLANT.fields(links)
    fields = {name: field for name, field in MPC.fields(links).items() if name in of_plant}
    for name, value in known.items():
        if name not in fields:
            raise unknown(name, 'mpc', fields)
        checked(fields[name], value, name)


def table(found: Identified) -> str:
    """Return a Markdown table of what was found, then of what was not: a row a parameter."""
    links = len(found.rms('after')) - 1
    fields = MPC.fields(links)

    def unit(name: str) -> str:
        return fields[name].metadata['unit'] if name in fields else 'rad'
    rows = [['parameter', 'value', '95 %', 'before', 'unit']]
    for name, (low, high) in found.intervals.items():
        rows.append([name, number(found.values[name]), f'{number(low)} to {number(high)}',
                     number(found.before[name]), unit(name)])
    rows += [[name, number(found.values[name]), why_not(found, name),
              number(found.before[name]), unit(name)]
             for name in (*found.at_bound, *found.unidentified)]
    return aligned(rows, names=1)


def base_table(found: Identified) -> str:
    """Return a Markdown table of what motion tells of the bodies, however they share it."""
    return aligned([['base parameter', 'value', '95 %', 'unit'], *(
        [name, number(of.value), f'{number(of.low)} to {number(of.high)}', of.unit]
        for name, of in found.base.items())], names=1)


def why_not(found: Identified, name: str) -> str:
    """Return why a parameter has no interval."""
    return BOUND if name in found.at_bound else found.held.get(name, UNTOLD)


def report(found: Identified, motions: Sequence[Recorded]) -> str:
    """Return in words how well predictions fit, what was held and why, and how times are meant."""
    used = sum(each.segments.t.size for each in found.predictions)
    before, after = found.rms('before'), found.rms('after')
    span = max(np.ptp(each.segments.t, axis=1).max() for each in found.predictions)
    lines = [f'error of predictions over {span:.2g} s, RMS: ' + ', '.join(
        f'{joints(len(after) - 1)[i]} {1e3 * before[i]:.3g} -> {1e3 * after[i]:.3g} '
        f'{"mrad" if i else "mm"}' for i in found.joints)]
    lines += explained(found, motions)
    lines.append(f'{used} of {sum(len(each.motion.t) for each in motions)} states used')
    if found.at_bound:
        lines.append(f'{", ".join(found.at_bound)}: {BOUND}, and what else was found goes with '
                     'that; begin with bodies nearer to those of the rig, or give some with '
                     '--known')
    if found.left_out:
        lines.append(f'segments left out that no parameters explain: {found.left_out}')
    lines += [f'{name} held at {number(found.values[name])}: {why}'
              for name, why in found.held.items()]
    lines += list(dict.fromkeys(each.times for each in motions)) if found.cart == FREE else [
        'the motion of the cart is given: nothing is said of what moves it']
    return '\n'.join(lines)


def explained(found: Identified, motions: Sequence[Recorded]) -> list[str]:
    """Return in words whether what is missed is what encoders round off, where such are seen."""
    rms = found.rms('after')
    names = joints(len(rms) - 1)
    steps = [np.max([resolution(each.motion.Q[:, i]) for each in motions])
             for i in range(len(rms))]
    seen = [i for i in found.joints if steps[i] > 0]
    if not seen:
        return []
    off = [i for i in seen if rms[i] > CLEARLY * steps[i] / math.sqrt(12)]
    shown = ', '.join(f'{names[i]} {1e3 * steps[i]:.3g} {"mrad" if i else "mm"}' for i in seen)
    return [f'that explains the motion to within the encoders, whose steps are: {shown}'
            if not off else 'something else moves here, or the encoders are worse than their '
            f'steps ({shown}): ' + ', '.join(
                f'{names[i]} is off by {rms[i] / steps[i] * math.sqrt(12):.2g} times what these '
                'round off' for i in off)]


def told_in(bag: Bag) -> dict[str, str]:
    """Return drive and limits that the mpc of a bag was told, as in YAML; raises BagError."""
    configured = configurations_of(bag).get(CONTROLLER)
    told = {} if configured is None else {
        name: value for name, value in configured.parameters.items() if name in LIMITS}
    return {**{name: number(float(value)) for name, value in told.items()
               if math.isfinite(value)}, 'drive': drive_of(bag)}


def parameter_file(found: Identified, sensors: SensorParameters, bags: Iterable[Path],
                   told: Mapping[str, str]) -> str:
    """
    Return the text of a ROS parameter file with what mpc and plant both have.

    So are drive and limits, of which motion tells nothing: they are as told.
    """
    links = len(sensors.joint_offsets) - 1
    both = shared(links)
    lines = [f'# Identified from {", ".join(path.name for path in bags)}; intervals of 95 %.',
             '/**:', '  ros__parameters:', f'    links: {links}',
             *(f'    {name}: {value}  # as the mpc was told' for name, value in told.items())]
    for name, value in found.values.items():
        if name in found.intervals:
            why = ' to '.join(map(number, found.intervals[name]))
        else:
            why = why_not(found, name)
        if name in both:
            lines.append(f'    {name}: {number(value)}  # {why}')
    balances = np.array([found.values[f'link{i}_balance'] for i in range(1, links + 1)])
    if sensors.zero != HANGING:   # else it is found anew at each start
        offsets = (f'{each:.9g}' for each in sensors.balanced_at(balances).joint_offsets)
        lines.append('    # links of the rig, but not of a simulated twin, stand balanced where '
                     f'the mpc has joint_offsets: [{", ".join(offsets)}]')
    return '\n'.join(lines) + '\n'


def number(value: float) -> str:
    """Return a number that is read as one with a fraction, as ROS wants it."""
    return repr(float(f'{0.0 if abs(value) < NOTHING else value:.5g}'))
