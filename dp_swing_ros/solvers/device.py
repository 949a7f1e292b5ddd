# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Samples of MPPI by torch, all of them on one device; what samples.py does on the CPU.

On a GPU a step of all samples is compiled into one kernel where Triton is installed, and the whole
horizon is recorded as a CUDA graph. So nothing that changes from update to update is a constant of
the program: model, cost and policies are packed into one array that is copied to the device.
"""

from dataclasses import dataclass
import functools
import importlib.util
import math
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from dp_swing_ros.kernels.compilation import Constant, mapped
from dp_swing_ros.kernels.symbols import dot, flat
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.model import advance, Model
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.cost import Cost, running_cost, terminal_cost
from dp_swing_ros.problem.problem import Problem, Rollout

DEVICES = {'cuda': 'cuda', 'torch': 'cpu'}   # by the value of the parameter


class Inputs(NamedTuple):
    """What changes from update to update; a policy is u = offset + gain x."""

    model: Model
    cost: Cost
    bounds: Any     # () each
    x_0: Any        # (2n + 2,)
    offsets: Any    # (N,)
    gains: Any      # (N, 2n + 2)


@dataclass(frozen=True)
class Sized:
    """Stands for an array of a size in what a program is made for."""

    size: tuple[int, ...]


def leaves(structure: Any) -> list[Any]:
    """Return the numbers and arrays of a structure in order, without what is constant."""
    return [each for each in flat(structure) if not isinstance(each, Constant)]


def step(inputs: Inputs, x: list[Tensor], offset: Tensor, gain: Tensor,
         noise: Tensor) -> tuple[list[Tensor], Tensor, Tensor]:
    """
    Return the states after one step, the forces, and the running costs.

    Shapes: (K,) for K samples; offset (), gain (2n + 2,).
    """
    u = torch.clamp(noise + offset + dot(gain.unbind(), x), *inputs.bounds)
    return list(advance(inputs.model, x, u)), u, running_cost(inputs.cost, x, u)


def copy_of(function: Any) -> FunctionType:
    """
    Return a function with a code object of its own.

    torch compiles a code object eight times at most; for a ninth size it would run uncompiled,
    some fifty times slower.
    """
    return FunctionType(function.__code__.replace(), function.__globals__, function.__name__)


@functools.lru_cache(maxsize=4)
def compiled(kind: Inputs, samples: int) -> Any:
    """Return `step` compiled for inputs of a kind, however many steps there are."""
    return torch.compile(copy_of(step), dynamic=False)


# estimated parameters change the problem, but not the program; the rate of the states, and how
# far the goal is, change the steps
@functools.lru_cache(maxsize=8)
class Program:
    """The samples of one update; compiled and recorded once, for all problems of a size."""

    def __init__(self, place: str, kind: Inputs, correlation: float, sigma: bytes) -> None:
        """Take the torch device and all that the program is made for; reserve the memory."""
        self.kind, self.correlation = kind, correlation
        self.sizes = [each.size for each in leaves(kind)]
        self.sigma = torch.tensor(np.frombuffer(sigma, np.float32), device=place)
        K, N = len(self.sigma), kind.offsets.size[0]
        self.packed = torch.zeros(sum(map(math.prod, self.sizes)), device=place)
        self.noise, self.forces = torch.zeros((2, N, K), device=place)
        self.costs = torch.zeros(K, device=place)
        self.random = torch.Generator(place)
        self.step, self.run = step, self.follow
        if place == 'cuda':
            if importlib.util.find_spec('triton'):
                of_a_step = kind._replace(offsets=Sized(()), gains=kind.x_0)
                self.step = compiled(of_a_step, K)
            self.run = self.recorded()

    def recorded(self) -> Any:
        """Record a run as a CUDA graph, after some that compile, and return what replays it."""
        stream = torch.cuda.Stream()
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            for _ in range(3):
                self.follow()
        torch.cuda.current_stream().wait_stream(stream)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            self.follow()
        return graph.replay

    def take(self, inputs: Inputs) -> None:
        """Copy the inputs of an update to the device."""
        with np.errstate(over='ignore'):    # a proposal that diverges weighs nothing
            packed = np.concatenate([np.ravel(part) for part in leaves(inputs)]).astype(np.float32)
        self.packed.copy_(torch.from_numpy(packed))

    def follow(self) -> None:
        """Follow the policies under the noise; write forces and costs."""
        parts = iter(self.packed.split(list(map(math.prod, self.sizes))))
        inputs: Inputs = mapped(lambda each: next(parts).view(each.size), self.kind)
        x = [number.expand(len(self.sigma)) for number in inputs.x_0]
        fresh = (1 - self.correlation ** 2) ** 0.5
        coloured = self.noise[0]
        self.costs.zero_()
        for t in range(len(self.noise)):
            if t > 0:
                coloured = self.correlation * coloured + fresh * self.noise[t]
            x, self.forces[t], running = self.step(
                inputs, x, inputs.offsets[t], inputs.gains[t], self.sigma * coloured)
            self.costs += running
        self.costs += terminal_cost(inputs.cost, x)


class DeviceSamples:
    """Samples of one problem by torch; the random numbers come of a NumPy generator's."""

    noise_time = 0.0   # [s] of the last draw: the device draws while it follows

    def __init__(self, problem: Problem, sigma: Array, correlation: float, device: str,
                 name: str) -> None:
        """
        Take the problem, and the sizes of the noise of each sample (K,), in float32.

        name is that of the parameter that names the device. Raises ParameterError where there is
        no such device.
        """
        if device == 'cuda' and not torch.cuda.is_available():
            raise ParameterError(
                f"parameter {name} is 'cuda', but torch "
                f'{torch.__version__} finds no CUDA GPU; expected an NVIDIA GPU, its driver and a '
                f'CUDA build of torch, or {name} cpu')
        self.problem = problem
        N, size = problem.horizon, len(problem.cost.S)
        zero = Rollout(0.0, np.zeros((N + 1, size)), np.zeros(N), np.zeros((N, size)))
        kind = mapped(lambda part: Sized(np.shape(part)), self.inputs(zero))
        self.program = Program(DEVICES[device], kind, correlation, sigma.tobytes())

    def inputs(self, best: Rollout) -> Inputs:
        """Gather the inputs of an update, as arrays and numbers."""
        _, X, U, K = best
        return Inputs(self.problem.model, self.problem.cost, self.problem.bounds, X[0],
                      U - np.sum(K * X[:-1], axis=1), K)

    def draw(self, best: Rollout, random: np.random.Generator) -> Array:
        """Draw samples about a rollout; return their costs (K,)."""
        program = self.program
        program.random.manual_seed(int(random.integers(2 ** 63)))
        program.noise.normal_(generator=program.random)
        program.take(self.inputs(best))
        program.run()
        costs: Array = program.costs.cpu().numpy()
        return costs

    def proposals(self, w: Array) -> Array:
        """Return the weighted average of the samples, and the heaviest; w (K,) -> (2, N)."""
        forces = self.program.forces
        return on_host(torch.stack([forces @ torch.from_numpy(w).to(forces),
                                    forces[:, int(np.argmax(w))]]))

    def forces(self, index: int) -> Array:
        """Return the forces of one sample; -> (N,)."""
        return on_host(self.program.forces[:, index])

    def along(self, direction: Array) -> Array:
        """Return Σ_t direction[t] V[t] of every sample; direction (N,) -> (K,)."""
        forces = self.program.forces
        return on_host(torch.from_numpy(direction.astype(np.float32)).to(forces.device) @ forces)


def on_host(tensor: Tensor) -> Array:
    """Return a tensor as an array in double precision."""
    found: Array = tensor.cpu().double().numpy()
    return found
