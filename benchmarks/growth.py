# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How time and memory grow with horizon and samples; what a tick and an episode take."""

import time
import tracemalloc
from typing import Any

from campaigns import METHODS
import numpy as np
from timing import exponent, Interval, median, race, Work

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.contestants import parse, play
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import plan_of, Problem, regulator_rollout
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import answer
from dp_swing_ros.simulation.stepper import Stepper
from dp_swing_ros.solvers import SOLVERS

HORIZONS = (15, 30, 60, 120, 240)
SAMPLES = (256, 1024, 4096, 16384, 65536)
MANY = 1024          # samples, where the horizon grows, and of the tick
NEAR = (0.2, 0.05, -0.03, 0.0, 0.0, 0.0)
TICKS = 20           # before one is timed: the filter knows the state, the plan has settled
EPISODES = 5
DURATION = 10.0      # [s]


def iteration(name: str, problem: Problem, **of_solver: int) -> Work:
    """Return one iteration of a solver that holds the pendulum, with all that `solve` does."""
    solver = SOLVERS[name](problem, SOLVERS[name].Parameters(iterations=1, **of_solver))
    held = regulator_rollout(problem, np.array(NEAR))
    plan = plan_of(problem, held.X, held.U, Status.COMPLETE, held.K)

    def run() -> int:
        solver.solve(held.X[0], plan, np.inf)
        return 1
    return run


def growth(rounds: int, samples: tuple[int, ...] = SAMPLES) -> dict[str, Any]:
    """Return the times [s], the memory [byte] and the exponents, by horizon and by samples."""
    over_horizon = {name: {N: iteration(name, controllers.problem({'horizon': N}), **sampled)
                           for N in HORIZONS}
                    for name, sampled in (('ilqr', {}), ('ddp', {}), ('mppi', {'samples': MANY}))}
    default = controllers.problem({})
    over_samples = {K: iteration('mppi', default, samples=K) for K in samples}
    return {'horizon': {name: grown(works, rounds) for name, works in over_horizon.items()},
            'samples': {'mppi': grown(over_samples, rounds)}}


def grown(works: dict[int, Work], rounds: int) -> dict[str, Any]:
    """Time works of different sizes in turn."""
    times = race({str(size): work for size, work in works.items()}, rounds)
    medians = [median(of_size).value for of_size in times.values()]
    return {'sizes': list(works), 'seconds': medians,
            'bytes': [most_memory(work) for work in works.values()],
            'exponent': exponent(np.array(list(works)), np.array(medians))._asdict()}


def most_memory(work: Work) -> int:
    """Return the most memory [byte] that NumPy's arrays and Python's objects hold in a call."""
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def ticks(name: str, seconds: float, **mpc: Any) -> Array:
    """
    Return the times [s] of RecedingHorizon.update, default but for mpc, while it holds.

    The plant is the default one with noisy sensors; the filter is on.
    """
    controller = controllers.controller({'solver': name, **mpc})
    controller.warm_up()
    plant = plants.plant({'initial_state': NEAR, 'position_noise': 1e-3,
                          'velocity_noise': 0.05})
    stepper, times = Stepper(plant), []
    for _ in range(TICKS + round(seconds * plant.parameters.rate)):
        began = time.perf_counter()
        plan = answer(plant, stepper.begin(), controller)
        times.append(time.perf_counter() - began)
        assert plan is not None    # the plant loses no state
        stepper.finish(plan.first_force(plant.limits.force_limit))
    return np.array(times[TICKS:])


def holding(seconds: float) -> dict[str, Interval]:
    """Return the median of a tick of each solver."""
    return {name: median(ticks(name, seconds, **mpc)) for name, mpc in (
        ('ilqr', {}), ('ddp', {}), ('mppi', {'mppi.samples': MANY}))}


def episodes(count: int = EPISODES) -> dict[str, Interval]:
    """Return the time [s] of an episode of `evaluate` from hanging, in one process."""
    contestants = {name: parse(name) for name in METHODS}
    works = {}
    for name, contestant in contestants.items():
        cases = iter(SCENARIOS['hanging'].cases('hanging', range(count + 100), None, DURATION))

        def run(contestant: Any = contestant, cases: Any = cases) -> int:
            play(contestant, next(cases))
            return 1
        works[name] = run
    return {name: median(times) for name, times in race(works, count).items()}
