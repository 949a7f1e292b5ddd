# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Episodes of other people's pendulums on carts, run as these people define them.

A task resets, steps and pays by its own code; ours reads masses, lengths, frictions and limits
from its MuJoCo model, the state from its data, and answers with a force in each control step.
Source: Tassa et al., "dm_control: Software and tasks for continuous control", Software Impacts 6,
2020; Towers et al., "Gymnasium: A standard interface for reinforcement learning environments",
2024.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros import declarations
from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.state import Array, from_joints

STEPS = 1000     # of an episode at most, in all of these tasks
TOGETHER = 10    # steps whose rewards are stored as one number


class Reward(NamedTuple):
    """What a step was paid, and whether it was the last."""

    value: float
    last: bool


class Environment(NamedTuple):
    """An episode that has begun: MuJoCo's model and data, a control step, and how long it is."""

    model: Any
    data: Any
    step: Callable[[float], Reward]   # takes what drives the cart, from -1 to 1
    period: float                     # [s]


def dm_control(task: str, seed: int) -> Environment:
    """Begin an episode of dm_control's domain cartpole."""
    from dm_control import suite
    env = suite.load('cartpole', task, task_kwargs={'random': seed})
    env.reset()

    def step(action: float) -> Reward:
        now = env.step(np.array([action]))
        return Reward(now.reward, now.last())
    return Environment(env.physics.model, env.physics.data, step, env.control_timestep())


def gymnasium(task: str, seed: int) -> Environment:
    """Begin an episode of Gymnasium's MuJoCo environments."""
    import gymnasium
    env = gymnasium.make(task)
    env.reset(seed=seed)
    inner: Any = env.unwrapped

    def step(action: float) -> Reward:
        _, reward, terminated, truncated, _ = env.step(np.array([action]))
        return Reward(float(reward), terminated or truncated)
    return Environment(inner.model, inner.data, step, inner.dt)


class Task(NamedTuple):
    """A task: who begins its episodes, what it is called there, and the files of its tuned set."""

    begin: Callable[[str, int], Environment]
    name: str
    tuned: tuple[str, ...] = ()          # of config/
    tuned_mppi: tuple[str, ...] = ()     # what goes on top of these for MPPI


TASKS = {
    'two_poles': Task(dm_control, 'two_poles', ('dm_control.yaml',), ('dm_control_mppi.yaml',)),
    'three_poles': Task(dm_control, 'three_poles', ('dm_control_three_poles.yaml',)),
    'inverted_double_pendulum': Task(gymnasium, 'InvertedDoublePendulum-v5')}


class Episode(NamedTuple):
    """One episode: the seed is the environment's and the controller's."""

    task: str
    setup: str      # tuned or defaults
    solver: str
    seed: int


class Outcome(NamedTuple):
    """The sum of an episode's rewards, how many steps it took, and what TOGETHER of them paid."""

    total: float
    steps: int
    rewards: tuple[float, ...]


def parameters(model: Any) -> dict[str, Any]:
    """
    Return the parameters of a pendulum on a cart that MuJoCo's model of it says.

    Its joints are a slide along x and hinges about y; the links are symmetric about their middle.
    """
    cart, *links = model.jnt_bodyid
    found = {'links': len(links), 'cart_mass': model.body_mass[cart],
             'gravity': -model.opt.gravity[2], 'cart_friction': model.dof_damping[0],
             'force_limit': model.actuator_gear[0, 0] * model.actuator_ctrlrange[0, 1],
             'track_limit': model.jnt_range[0, 1]}
    for i, link in enumerate(links, 1):
        mass, length = model.body_mass[link], 2 * model.body_ipos[link, 2]
        found |= {f'link{i}_mass': mass, f'link{i}_length': length,
                  f'link{i}_inertia_factor': 12 * inertia(model, link) / (mass * length ** 2),
                  f'joint{i}_friction': model.dof_damping[i]}
    return {name: value if name == 'links' else float(value) for name, value in found.items()}


def inertia(model: Any, body: int) -> float:
    """Return the moment of inertia of a body about the y axis through its centre [kg m²]."""
    w, x, y, z = model.body_iquat[body]
    # the y axis in the frame of the principal axes: a row of the rotation matrix
    axis = np.array([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)])
    return float(model.body_inertia[body] @ axis ** 2)


def state(data: Any) -> Array:
    """
    Return the state [x, θ1 …, ẋ, θ̇1 …] from joints that count each from the link before.

    Both have upright as zero and lean to +x where an angle is positive. Shape: -> (2n + 2,).
    """
    return np.concatenate([from_joints(data.qpos), from_joints(data.qvel)])


def tuned(task: Task, solver: str) -> dict[str, Any]:
    """Return the tuned parameters of a task and a solver."""
    files = task.tuned + (task.tuned_mppi if solver == 'mppi' else ())
    return declarations.read(Path('config', file) for file in files)['mpc']


def play(episode: Episode, steps: int = STEPS) -> Outcome:
    """Play an episode, or the first steps of it."""
    task = TASKS[episode.task]
    environment = task.begin(task.name, episode.seed)
    own = parameters(environment.model)
    controller = controllers.controller({
        **own, **(tuned(task, episode.solver) if episode.setup == 'tuned' else {}),
        'estimator': 'none', 'solver': episode.solver, 'seed': episode.seed})
    u_max, rewards = own['force_limit'], list[float]()
    for n in range(steps):
        u = controller.update(n * environment.period, state(environment.data)).first_force(u_max)
        reward = environment.step(u / u_max)
        rewards.append(reward.value)
        if reward.last:
            break
    return Outcome(sum(rewards), len(rewards), tuple(
        float(np.mean(rewards[k:k + TOGETHER])) for k in range(0, len(rewards), TOGETHER)))
