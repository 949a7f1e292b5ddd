# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
An update of MPPI by torch, all of it on one device; what samples.py and mppi.py do on the CPU.

On a GPU a step of all samples is compiled into one kernel where Triton is installed, and the whole
horizon is recorded as a CUDA graph. So nothing that changes from update to update is a constant of
the program: model, cost and policies are packed into one array that is copied to the device.
"""

import functools
import importlib.util
import itertools
import math
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.torch_twin import ADVANCES, Numbers
from dp_swing_ros.problem.problem import Problem, Rollout
from dp_swing_ros.solvers.mppi import NEGLIGIBLE

DEVICES = {'cuda': 'cuda', 'torch': 'cpu'}   # by the value of the parameter


class Inputs(NamedTuple):
    """What changes from update to update, all in one array; a policy is u = offset + gain x."""

    model: Any      # (m,) its numbers in order
    S: Any          # (6,)
    R: Any          # ()
    P: Any          # (6, 6)
    x_r: Any        # (6,)
    x_soft: Any     # ()
    w: Any          # ()
    u_max: Any      # ()
    x_0: Any        # (6,)
    offsets: Any    # (N,)
    gains: Any      # (N, 6)


def numbers_of(model: Any) -> list[float]:
    """Return the numbers of a model in order."""
    return [number for part in model
            for number in (numbers_of(part) if isinstance(part, tuple) else [part])]


def restored(model: Any, numbers: Any) -> Any:
    """Return a model of the same kind with the numbers of an iterator."""
    return type(model)(*(restored(part, numbers) if isinstance(part, tuple) else next(numbers)
                         for part in model))


def step(model: Any, inputs: Inputs, chord: bool, x: Numbers, offset: Tensor, gain: Tensor,
         noise: Tensor) -> tuple[Numbers, Tensor, Tensor]:
    """
    Return the states after one step, the forces, and the running costs.

    Shapes: (K,) for K samples; offset (), gain (6,).
    """
    u = noise + offset
    for j in range(6):
        u = u + gain[j] * x[j]
    u = torch.clamp(u, -inputs.u_max, inputs.u_max)
    total = inputs.R * u * u + beyond(inputs, x[0])
    for j in range(6):
        reference = inputs.x_r[j]
        if chord and j in (1, 2):   # the distance of two points on the circle
            squared = ((x[j].sin() - reference.sin()) ** 2 + (x[j].cos() - reference.cos()) ** 2)
        else:
            squared = (x[j] - reference) ** 2
        total = total + inputs.S[j] * squared
    return ADVANCES[type(model)](model, x, u), u, total


def beyond(inputs: Inputs, x: Tensor) -> Tensor:
    """Return the cost of the soft margin of the track."""
    return inputs.w * torch.relu(x.abs() - inputs.x_soft) ** 2


def terminal(inputs: Inputs, chord: bool, x: Numbers) -> Tensor:
    """Return the terminal costs (K,)."""
    e = torch.stack(x) - inputs.x_r[:, None]
    if chord:
        e[1:3] = 2 * torch.sin(e[1:3] / 2)
    return ((inputs.P @ e) * e).sum(0) + beyond(inputs, x[0])


@functools.lru_cache(maxsize=4)   # the estimated bodies change the problem, but not the program
class Program:
    """The samples of one update; compiled and recorded once, for all problems of a size."""

    def __init__(self, place: str, model: Any, N: int, chord: bool, correlation: float,
                 sigma: bytes) -> None:
        """Take the torch device and all that the program is made for; reserve the memory."""
        self.model, self.chord, self.correlation = model, chord, correlation
        self.shapes = Inputs((len(numbers_of(model)),), (6,), (), (6, 6), (6,), (), (), (), (6,),
                             (N,), (N, 6))
        self.sigma = torch.tensor(np.frombuffer(sigma, np.float32), device=place)
        K = len(self.sigma)
        self.packed = torch.zeros(sum(map(math.prod, self.shapes)), device=place)
        self.noise, self.forces = torch.zeros((2, N, K), device=place)
        self.costs = torch.zeros(K, device=place)
        self.random = torch.Generator(place)
        self.step, self.run = step, self.follow
        if place == 'cuda':
            if importlib.util.find_spec('triton'):
                self.step = torch.compile(step, dynamic=False)
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
            packed = np.concatenate([np.ravel(part) for part in inputs]).astype(np.float32)
        self.packed.copy_(torch.from_numpy(packed))

    def follow(self) -> None:
        """Follow the policies under the noise; write forces and costs."""
        parts = self.packed.split([math.prod(shape) for shape in self.shapes])
        inputs = Inputs(*(part.view(shape) for part, shape in zip(parts, self.shapes)))
        model = restored(self.model, iter(inputs.model.unbind()))
        x: Numbers = tuple(number.expand(len(self.sigma)) for number in inputs.x_0)
        fresh = (1 - self.correlation ** 2) ** 0.5
        coloured = self.noise[0]
        self.costs.zero_()
        for t in range(len(self.noise)):
            if t > 0:
                coloured = self.correlation * coloured + fresh * self.noise[t]
            x, self.forces[t], running = self.step(
                model, inputs, self.chord, x, inputs.offsets[t], inputs.gains[t],
                self.sigma * coloured)
            self.costs += running
        self.costs += terminal(inputs, self.chord, x)


class OnDevice:
    """Updates of MPPI for one problem; the random numbers come of a NumPy generator's."""

    def __init__(self, problem: Problem, parameters: Any, sigma: Array) -> None:
        """
        Take MPPI's parameters, and the sizes of the noise (samples,).

        Raises ParameterError where there is no such device, or no such model in torch.
        """
        if parameters.device == 'cuda' and not torch.cuda.is_available():
            raise ParameterError(
                "parameter mppi.device is 'cuda', but torch "
                f'{torch.__version__} finds no CUDA GPU; expected an NVIDIA GPU, its driver and a '
                'CUDA build of torch, or mppi.device cpu')
        if type(problem.model) not in ADVANCES:
            raise ParameterError(f'parameter mppi.device is {parameters.device!r}, but the model '
                                 f'{type(problem.model).__name__} runs on the cpu alone')
        self.problem, self.parameters = problem, parameters
        template = restored(problem.model, itertools.repeat(0.0))
        self.program = Program(DEVICES[parameters.device], template, problem.horizon,
                               bool(problem.cost.chord), parameters.noise_correlation,
                               sigma.tobytes())

    def inputs(self, best: Rollout) -> Inputs:
        """Gather the inputs of an update, as arrays and numbers."""
        cost, (_, X, U, K) = self.problem.cost, best
        return Inputs(numbers_of(self.problem.model), cost.S, cost.R, cost.P, cost.x_r,
                      cost.x_soft, cost.w, self.problem.u_max, X[0],
                      U - np.sum(K * X[:-1], axis=1), K)

    def update(self, best: Rollout, random: np.random.Generator) -> Array:
        """Return the weighted average of samples about a rollout, and the cheapest (2, N)."""
        program = self.program
        program.random.manual_seed(int(random.integers(2 ** 63)))
        program.noise.normal_(generator=program.random)
        program.take(self.inputs(best))
        program.run()
        w = self.weights(program.costs)
        both = torch.stack([program.forces @ w, program.forces[:, torch.argmax(w)]])
        found: Array = both.cpu().double().numpy()
        return found

    def weights(self, J: Tensor) -> Tensor:
        """
        Return the weights of the samples, which sum to one; as MPPI.weights.

        Shapes: J (K,) -> (K,).
        """
        J = torch.where(torch.isfinite(J), J, torch.finfo(J.dtype).max)
        excess = J - J.min()
        temperature: Any = self.parameters.temperature
        if self.parameters.temperature_scale == 'relative':
            tenth = torch.kthvalue(excess, len(J) // 10 + 1).values
            temperature = temperature * torch.clamp(tenth, min=1e-9)
        exponent = excess / temperature
        w = torch.where(exponent < float(NEGLIGIBLE), torch.exp(-exponent), 0.0)
        return w / w.sum()
