# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The metrics of a run: pure functions of an episode."""

from collections.abc import Callable, Collection
import dataclasses
import enum
import math
from typing import Any

import numpy as np

from dp_swing_ros.control import controllers
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.parameters import acting, DRIVEN, LimitParameters
from dp_swing_ros.pendulum.state import angles, Array, is_upright, links_of
from dp_swing_ros.pendulum.units import SAME, Units
from dp_swing_ros.problem.parameters import CostParameters
from dp_swing_ros.problem.plan import FALLBACK
from dp_swing_ros.simulation.episode import Episode

HOLD = 1.0  # [s] scaled; upright for less than this at the end may be passing by
REST = 2.0  # [s] scaled, at the end of a run, over which holding is measured
CENTRE = 0.1  # [m] scaled, from the middle of the track, where the cart has settled as well
TIME_LIMIT = 0.04  # [s] for a solve, the mpc's default
TOUCH = 1e-6  # [m] from an end stop
ROUNDING = 1e-9  # [s]
WITHOUT_SOLVE = {status.name for status in FALLBACK}
# where the cart is driven, what acts is an acceleration; its energy nobody knows
OF_DRIVEN = {'N': 'm/s²', 'N s': 'm/s', 'N² s': 'm²/s³', 'J': None}


class Outcome(enum.Enum):
    """How a run ended; the value is a sentence for a reader."""

    HELD = 'upright to the end'
    STRUCK = 'upright to the end, after it met an end stop'
    DIVERGED = 'the state left the numbers'
    NEVER_UP = 'never upright'
    NEVER_HELD = 'upright in passing, never held'
    TOO_LATE = 'upright at the end, but too late to be held'
    FELL = 'held upright, then fell'


def quantity(label: str, unit: str = '', digits: int = 2, scale: float = 1.0) -> Any:
    """Declare one metric as a dataclass field; the table shows `scale` times its value."""
    return dataclasses.field(metadata={
        'label': label, 'unit': unit, 'digits': digits, 'scale': scale})


def named(label: str, unit: str, drives: Collection[str]) -> tuple[str, str | None]:
    """Return label and unit of a metric with some drives; None where it makes no sense."""
    units = dict.fromkeys(OF_DRIVEN.get(unit, unit) if drive in DRIVEN else unit
                          for drive in drives)
    known = [each for each in units if each is not None]
    return (label.replace('force', ' or '.join(dict.fromkeys(map(acting, drives)))),
            ' or '.join(known) if known else None)


@dataclasses.dataclass(frozen=True)
class Metrics:
    """
    The figures of one run in SI units; NaN where they are not known.

    What is a force elsewhere is an acceleration where the cart is driven.
    """

    success: bool = quantity('upright to the end, no strike')
    settling_time: float = quantity('settling time', 's')
    settling_time_with_cart: float = quantity(
        'settling time, the cart near the centre, too', 's')
    settling_offset: float = quantity('cart from the centre when settled', 'm')
    rest_offset: float = quantity('largest cart position at rest', 'm', digits=3)
    hold_error: float = quantity('angle error at rest (RMS)', 'rad', digits=4)
    smoothness: float = quantity('force step at rest (std)', 'N', digits=3)
    roughness: float = quantity('force step, all the run (std)', 'N', digits=3)
    largest_force: float = quantity('largest force u', 'N')
    largest_position: float = quantity('largest position x', 'm')
    largest_angle: float = quantity('largest angle error after the start', 'rad')
    strikes: int = quantity('track strikes')
    uptime: float = quantity('time upright', '%', digits=1, scale=100.0)
    energy: float = quantity('energy of the force, unsigned', 'J')
    impulse: float = quantity('force over time, unsigned', 'N s')
    squared_force: float = quantity('squared force over time', 'N² s', digits=1)
    squared_speed: float = quantity('squared joint speeds over time', 'rad²/s', digits=1)
    closed_loop_cost: float = quantity('running cost with default weights', digits=0)
    median_solve_time: float = quantity('solve time, median', 'ms', scale=1e3)
    p99_solve_time: float = quantity('solve time, p99', 'ms', scale=1e3)
    largest_solve_time: float = quantity('solve time, largest', 'ms', scale=1e3)
    median_latency: float = quantity('latency, median', 'ms', scale=1e3)
    p99_latency: float = quantity('latency, p99', 'ms', scale=1e3)
    late_ticks: int = quantity('late ticks')
    deadline_misses: int = quantity('solves over their time limit')
    stand_ins: int = quantity('ticks without a solve')
    ticks: int = quantity('ticks')
    states: int = quantity('states')
    duration: float = quantity('duration', 's')


def measure(episode: Episode, time_limit: float = TIME_LIMIT) -> Metrics:
    """
    Measure a run.

    It succeeds when all angles stay within 0.1 rad of the goal's and all speeds under 1 over its
    last second (or all of it, where it is shorter) and the cart never met an end stop; it has
    settled where that last unbroken stay begins, wherever the cart is then. A strike is the cart's
    coming to an end stop, however long it stays there. Solve times are those of the ticks that
    solved, which took some time; one longer than time_limit [s] misses its deadline. Speeds and
    times are those of the default bodies; they are the same in own units for others, as the last
    two seconds, which count as rest, are, and the 0.1 m within which the cart is near the centre.
    """
    t, ticks = np.asarray(episode.t, dtype=float), episode.ticks
    solve_times = ticks.solve_time[ticks.solve_time > 0]
    links, U, dt = links_of(episode.X), episode.U, np.diff(t)
    X, E, scale = episode.X, episode.errors, scale_of(episode.bodies)
    settled, struck, up = settling_time(t, E, scale), strikes(episode), is_upright(E, scale)
    rest = (t >= t[-1] - scale.sized(REST, 's')) if t.size else np.zeros(0, dtype=bool)
    # of the joints, as encoders see them: the angles of the state are absolute; a sum is the same
    # to the bit only in the same order
    joint_speeds = np.diff(X[:-1, links + 2:].T.copy(), axis=0, prepend=0.0)
    return Metrics(
        success=not math.isnan(settled) and not struck,
        settling_time=settled,
        settling_time_with_cart=last_stay(
            t, up & (np.abs(E[:, 0]) <= scale.sized(CENTRE, 'm')), scale),
        settling_offset=_largest(E[t == settled, 0]),
        rest_offset=_largest(E[rest, 0]),
        hold_error=reduced(lambda errors: np.sqrt(np.mean(np.square(errors))),
                           E[rest, angles(E)]),
        # the force of the period that starts at a state
        smoothness=reduced(np.std, np.diff(U[rest[:-1]])),
        roughness=reduced(np.std, np.diff(U)),
        largest_force=_largest(U),
        largest_position=_largest(X[:, 0]),
        largest_angle=_largest(E[1:, angles(E)]),
        strikes=struck,
        uptime=reduced(np.mean, up),
        energy=math.nan if episode.bodies.is_driven else float(
            np.sum(np.abs(np.diff(X[:, 0]) * U))),
        impulse=float(np.sum(np.abs(U) * dt)),
        squared_force=float(np.sum(U ** 2 * dt)),
        squared_speed=float(np.sum(joint_speeds ** 2 * dt)),
        closed_loop_cost=closed_loop_cost(episode),
        median_solve_time=quantile(solve_times, 0.5),
        p99_solve_time=quantile(solve_times, 0.99),
        largest_solve_time=quantile(solve_times, 1.0),
        median_latency=quantile(ticks.latency, 0.5),
        p99_latency=quantile(ticks.latency, 0.99),
        late_ticks=int(np.count_nonzero(ticks.late)),
        deadline_misses=int(np.count_nonzero(solve_times > time_limit)),
        stand_ins=sum(status in WITHOUT_SOLVE for status in ticks.status),
        ticks=len(ticks.t),
        states=len(t),
        duration=float(t[-1] - t[0]) if t.size else math.nan)


def outcome(episode: Episode) -> Outcome:
    """Return how a run ended, and where it failed, how."""
    t, E, scale = np.asarray(episode.t, dtype=float), episode.errors, scale_of(episode.bodies)
    up = is_upright(E, scale)
    if not np.all(np.isfinite(episode.X)):
        return Outcome.DIVERGED
    if not math.isnan(settling_time(t, E, scale)):
        return Outcome.STRUCK if strikes(episode) else Outcome.HELD
    if not up.any():
        return Outcome.NEVER_UP
    changes = np.flatnonzero(np.diff(up, prepend=False, append=False))
    longest = max(t[end - 1] - t[begin] for begin, end in zip(changes[::2], changes[1::2]))
    if longest >= scale.sized(HOLD, 's') - ROUNDING:
        return Outcome.FELL
    return Outcome.TOO_LATE if up[-1] else Outcome.NEVER_HELD


def strikes(episode: Episode) -> int:
    """Return how often the cart came to an end stop."""
    at_stop = np.abs(episode.X[:, 0]) >= episode.limits.track_limit - TOUCH
    return int(np.count_nonzero(np.diff(at_stop.astype(int), prepend=0) > 0))


def settling_time(t: Array, E: Array, scale: Units = SAME) -> float:
    """Return when (N,) [s] the errors E (N, 2n + 2) last became small, NaN as of last_stay."""
    return last_stay(t, is_upright(E, scale), scale)


def last_stay(t: Array, inside: Array, scale: Units = SAME) -> float:
    """
    Return the start [s] of the last unbroken stay to the end, NaN where it is shorter than HOLD.

    Shapes: t (N,) [s], inside (N,) bool.
    """
    outside = np.flatnonzero(~inside)
    first = int(outside[-1]) + 1 if outside.size else 0
    # a stay that began with the run counts however short the run is
    if first == len(t) or (
            first > 0 and t[-1] - t[first] < scale.sized(HOLD, 's') - ROUNDING):
        return math.nan
    return float(t[first])


def closed_loop_cost(episode: Episode) -> float:
    """
    Return Σ ℓ(x, u) over the periods of a run, by the default weights for its bodies.

    So the controller's own do not matter.

    Source: cost.py, `running`, whose angle error is the chord.
    """
    U, X, error = episode.U, episode.X, episode.errors[:len(episode.U)]
    values = controllers.MPC.complete(episode.bodies.by_name)
    cost, limits = group(CostParameters, values), group(LimitParameters, values)
    error[:, angles(X)] = 2 * np.sin(error[:, angles(X)] / 2)
    intrusion = np.maximum(0, np.abs(X[:len(U), 0]) - limits.track_limit + cost.track_margin)
    return float(np.sum(error ** 2 @ np.array(cost.state_weights) + cost.force_weight * U ** 2
                        + cost.track_weight * intrusion ** 2)) if len(U) else math.nan


def quantile(values: Array, share: float) -> float:
    """Return a quantile of the values that are finite, NaN where there are none."""
    values = np.asarray(values, dtype=float)
    return reduced(lambda known: np.quantile(known, share), values[np.isfinite(values)])


def reduced(reduce: Callable[[Array], Any], values: Array) -> float:
    """Reduce values to a number, NaN where there are none."""
    return float(reduce(values)) if np.size(values) else math.nan


def _largest(values: Array) -> float:
    return reduced(np.max, np.abs(values))
