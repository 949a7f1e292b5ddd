# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Episodes that are made up, to test what looks at them."""

import dataclasses

import numpy as np

from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.simulation.episode import Episode, Ticks

PERIOD = 0.05  # [s]


def swing_up(duration: float = 4.0, rise: float = 2.0, solver: str = 'ilqr',
             links: int = 2) -> Episode:
    """
    Return a run whose links turn upright over `rise` seconds and stay.

    The angles of every second link go on to a full turn.
    """
    t = PERIOD * np.arange(round(duration / PERIOD) + 1)
    s = np.clip(t / rise, 0.0, 1.0)
    turned, speed = s ** 3 * (10 - 15 * s + 6 * s ** 2), 30 * (s * (1 - s)) ** 2 / rise
    wave = np.pi * s * (1 - s) ** 2
    ways = (-1, 1, -1)[:links]
    X = np.stack([0.5 * wave, *(np.pi * (1 + way * turned) for way in ways),
                  np.gradient(0.5 * wave, PERIOD), *(way * np.pi * speed for way in ways)], axis=1)
    ticks = len(t) - 1
    return Episode(
        t=t, X=X, U=20 * np.sin(7 * t[:-1]) * (s[:-1] < 1),
        ticks=Ticks(t=t[:-1], cost=np.full(ticks, 5.0), iterations=np.full(ticks, 3),
                    solve_time=np.linspace(0.001, 0.003, ticks),
                    latency=np.linspace(0.002, 0.004, ticks), late=np.zeros(ticks, dtype=bool),
                    status=['CONVERGED'] * ticks),
        solver=solver, physical=PendulumParameters(links=links), limits=LimitParameters())


def resized(episode: Episode, length: float, mass: float = 1.0) -> Episode:
    """Return the same run of a pendulum so many times longer and heavier."""
    time, links, physical = length ** 0.5, episode.physical.links, episode.physical
    units = [length, *[1.0] * links]
    bodies = {f'link{i}_length': length * physical.lengths[i - 1] for i in range(1, links + 1)}
    bodies |= {f'link{i}_mass': mass * physical.masses[i] for i in range(1, links + 1)}
    limits, ticks = episode.limits, episode.ticks
    return dataclasses.replace(
        episode, t=time * episode.t, U=mass * episode.U,
        X=episode.X * np.concatenate((units, np.divide(units, time))),
        ticks=ticks._replace(t=time * ticks.t, solve_time=time * ticks.solve_time,
                             latency=time * ticks.latency),
        physical=dataclasses.replace(physical, cart_mass=mass * physical.cart_mass, **bodies),
        limits=LimitParameters(mass * limits.force_limit, length * limits.track_limit))


def first(episode: Episode, states: int) -> Episode:
    """Return the beginning of a run."""
    ticks = max(states - 1, 0)
    return dataclasses.replace(
        episode, t=episode.t[:states], X=episode.X[:states], U=episode.U[:ticks],
        ticks=Ticks(*(column[:ticks] for column in episode.ticks)))


def without_ticks(episode: Episode) -> Episode:
    """Return a run that nobody controlled."""
    return dataclasses.replace(
        episode, solver='', ticks=Ticks(*(column[:0] for column in episode.ticks)))
