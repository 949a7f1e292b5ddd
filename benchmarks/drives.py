# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drives as they are sold: voltages, accelerations, velocities; with links of a real pendulum."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from campaigns import CONFIG, METHODS
from links import OUTCOME, outcome
from recordings import AUTHORS

from dp_swing_ros import declarations
from dp_swing_ros.evaluation.campaign.contestants import Contestant, key
from dp_swing_ros.evaluation.campaign.rows import Row
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.pendulum.parameters import LimitParameters
from dp_swing_ros.tables import compact

TIP = 1.35   # times as far as its centre a last link is drawn
# encoders alone, on what another engine moves
SENSED = {'engine': 'mujoco', 'rate': 200.0, 'encoder_counts': 2000, 'velocities': 'none'}


class Group(NamedTuple):
    """Some episodes of all solvers with one rig, which the mpc is told."""

    rig: str
    told: dict[str, Any]
    plant: dict[str, Any]
    scenario: str
    seeds: int
    duration: float   # [s]

    @property
    def space(self) -> str:
        """Return how far the cart may go."""
        track = self.told.get('track_limit', LimitParameters.track_limit)
        return f'±{track:g}'

    @property
    def drive(self) -> str:
        """Return the drive in words."""
        told = self.told
        limits = [f'{told[name]:g} {unit}' for name, unit in (
            ('force_limit', 'V'), ('acceleration_limit', 'm/s²'), ('cart_speed_limit', 'm/s'))
            if name in told]
        return f'`{told["drive"]}`, {", ".join(limits)}'


def published(name: str) -> dict[str, Any]:
    """Return links as they were published, as parameters."""
    g, links = AUTHORS[name]
    values = {'links': len(links), 'gravity': g}
    for i, link in enumerate(links, 1):
        values.update({
            f'link{i}_mass': link.mass, f'link{i}_centre': link.centre,
            f'link{i}_length': link.length or TIP * link.centre,
            f'link{i}_inertia': link.inertia, f'joint{i}_friction': link.friction})
    return values


def motor() -> dict[str, Any]:
    """Return the cart and the motor of config/voltage.yaml."""
    found = declarations.read([CONFIG / 'voltage.yaml'])['mpc']
    return {name: found[name] for name in (
        'drive', 'force_gain', 'cart_friction', 'cart_mass', 'force_limit')}


def follower(acceleration: float, speed: float) -> dict[str, Any]:
    """Return a servo with limits [m/s², m/s] that follows 20 ms late."""
    return {'drive': 'velocity', 'acceleration_limit': acceleration, 'cart_speed_limit': speed,
            'motor_time_constant': 0.02}


def real(name: str, drive: Mapping[str, Any], duration: float, track: float = 0.5) -> Group:
    """Return a group with the links of a real pendulum, hanging at first, on a track [m]."""
    return Group(name, {**published(name), 'track_limit': track, **drive}, SENSED, 'hanging', 60,
                 duration)


STEPPER = {'drive': 'acceleration', 'acceleration_limit': 20.0}
GROUPS = [
    Group('default', STEPPER, {}, 'hanging', 100, 10.0),
    Group('default', STEPPER, {}, 'random', 200, 10.0),
    real('single', follower(5.0, 1.0), 12.0),
    real('double', follower(5.0, 1.0), 40.0),
    real('triple', follower(40.0, 3.0), 30.0, track=1.0),
    *(real(name, motor(), 12.0 if name == 'triple' else 6.0) for name in AUTHORS)]


def of_group(group: Group, solver: str) -> list[tuple[Contestant, Case]]:
    """Return the episodes of a line of the page."""
    names = declarations.shared(group.told.get('links', 2))
    values = {name: value for name, value in group.told.items() if name in names}
    contestant = Contestant(f'{solver}, {group.rig}, {group.drive}', solver,
                            {**values, **group.plant}, group.told)
    cases = SCENARIOS[group.scenario].cases(
        group.scenario, range(group.seeds), None, group.duration, group.told.get('links', 2))
    return [(contestant, case) for case in cases]


def episodes() -> list[tuple[Contestant, Case]]:
    """Return the episodes of all lines."""
    return [episode for group in GROUPS for solver in METHODS
            for episode in of_group(group, solver)]


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from the rows of all runs."""
    found = {row.key: row for row in rows}
    lines = [(group.rig, group.drive, group.space, f'{group.duration:g}', group.scenario,
              f'`{solver}`',
              *outcome([found[key(*one)] for one in of_group(group, solver)]))
             for group in GROUPS for solver in METHODS]
    return '\n'.join([
        '# Drives\n', made,
        'The input of the problem is a voltage, an acceleration, or for velocities the '
        'acceleration whose integral they are ([how](../rig.md#what-your-drive-takes)). Of '
        '`default` the bodies are those of 1 m, at 20 Hz. Else links are those that were '
        'published of [a real pendulum](#what-is-found-of-a-real-pendulum), moved by MuJoCo, '
        f'{SENSED["rate"]:g} states a second from encoders of {SENSED["encoder_counts"]:,} counts '
        'a turn, without velocities. Each episode lasts as long as stands there in the time of '
        'links of 1 m; with real ones it is as much shorter as these are faster. A velocity is '
        'followed 20 ms late, within the acceleration that stands there; the motor of the voltage '
        'is that of `config/voltage.yaml`. The mpc is told all of it but the sensors, and has the '
        'defaults else. In brackets the 95 % interval (Wilson); settling times are those of the '
        'successes; the rows: `results/drives.csv.gz`.\n',
        compact([('links', 'drive', 'track [m]', 'episode [s]', 'scenario', 'solver', *OUTCOME),
                 *lines]), ''])
