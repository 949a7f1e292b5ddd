# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Rigs whose structure is another: the mass of a link is not about the middle of a rod.

It lies beside the line of the joints, as with a bracket or a bent link, or further along it, as
with a weight at the end.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from campaigns import DURATION
import numpy as np

from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.dynamics.structured import harmonics, pairs, Structured
from dp_swing_ros.evaluation.scenarios import Case, rig
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import DEFAULT_LINKS, to_joints
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.engines import ENGINES, MuJoCo

POSES = 50           # more than there are harmonics


class Uneven(MuJoCo):
    """Links whose centres of mass lie elsewhere than in the middle between their joints."""

    beside, along = 0.0, 0.5   # [m], and as a share of the length

    def __init__(self, physical: PendulumParameters, limits: LimitParameters,
                 integrator: str) -> None:
        """Take what any engine takes, and move the centres."""
        super().__init__(physical, limits, integrator)
        centres = self.model.body_ipos[2:]   # the first are of the world and the cart
        centres[:, 0] = self.beside
        centres[:, 2] = self.along * np.array(physical.lengths)
        self.mujoco.mj_setConst(self.model, self.data)


class Beside(Uneven):
    """Links of which the mass lies beside the line of the joints."""

    beside = 0.03


class Along(Uneven):
    """Links of which the mass lies beyond the middle."""

    along = 0.65


ADDED: dict[str, type[Uneven]] = {'beside': Beside, 'along': Along}


@contextmanager
def engines() -> Iterator[None]:
    """Let plants be moved by these, too."""
    ENGINES.update(ADDED)
    try:
        yield
    finally:
        for name in ADDED:
            del ENGINES[name]


class UnevenRig(NamedTuple):
    """A rig that one of these moves; see Rig."""

    engine: str
    level: None = None

    @property
    def scenario(self) -> str:
        """Return what it is called where results are stored."""
        return f'rig_{self.engine}'

    def cases(self, seeds: range) -> list[Case]:
        """Return its cases."""
        return [rig(Case(self.scenario, seed, DURATION, plant={'engine': self.engine}),
                    DEFAULT_LINKS) for seed in seeds]


def exact(case: Case) -> LearnedModel:
    """Return as a model what such a rig is, from MuJoCo's mass matrix and potential."""
    plant = plants.plant(case.plant)
    engine, pendulum = plant.engine, Pendulum.of(plant.physical)
    assert isinstance(engine, Uneven)
    n, model, data, mujoco = pendulum.links, engine.model, engine.data, engine.mujoco
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, (POSES, n))
    ours = np.array([to_joints(row) for row in np.eye(n + 1)])   # each of our speeds, by joints
    D, V = np.zeros((POSES, n + 1, n + 1)), np.zeros(POSES)
    for pose, theta in enumerate(angles):
        data.qpos[:] = to_joints(np.array([0.0, *theta]))
        mujoco.mj_forward(model, data)
        for i, speeds in enumerate(ours):
            momenta = np.zeros(n + 1)
            mujoco.mj_mulM(model, data, momenta, speeds)
            D[pose, i] = ours @ momenta
        V[pose] = -model.opt.gravity[2] * model.body_mass @ data.xipos[:, 2]
    basis = np.array([[each.value for each in harmonics(np.sin(theta), np.cos(theta))]
                      for theta in angles])
    upper = np.array([D[:, i, j] for i, j in pairs(n)]).T
    inertia, potential = (np.linalg.lstsq(basis, of, rcond=None)[0] for of in (upper, V))
    dynamics = Structured.of(pendulum)._replace(
        inertia=inertia.T.copy(), potential=np.append(0.0, potential[1:]))
    return LearnedModel(dynamics, np.ones(n + 1), {})
