# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The weights of a network from experience, by torch.

    min over all weights  Σ_k log(1 + |q̇⁺_k - f(x_k, u_k)|²_Σ) + decay (|W|² + |V|²)

f is one step of the integrator, by the same equations as in the kernels. The logarithm, that of
Student's t, keeps the few wild transitions from deciding all. Experience that is held out says
when to stop. The last layer is fitted again afterwards, with what is uncertain about it:
see regression.py.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from dp_swing_ros.dynamics.kinds import BlackBox, Residual
from dp_swing_ros.dynamics.network import inputs, Network, Widths
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.pendulum.integrators import rk4
from dp_swing_ros.pendulum.state import Array

ROUNDS = 60          # of the optimiser, at most
INNER = 20           # of its steps in a round
PATIENCE = 8         # rounds without a better error on what is held out
DECAY = 1e-4
NOISE = 2e-2         # [s] standard deviation of a residual, per acceleration of the experience


class Layers(NamedTuple):
    """The weights of a Network as tensors, for numbers that are tensors (K,)."""

    widths: Widths
    W: Tensor
    b: Tensor
    V: Tensor
    c: Tensor

    def outputs(self, s: list[Tensor], c: list[Tensor], rates: list[Tensor]) -> list[Tensor]:
        """Return y; see Network.outputs."""
        hidden = torch.stack(inputs(s, c, rates), -1) @ self.W.T + self.b
        squashed = hidden * torch.rsqrt(1.0 + hidden * hidden)
        return list((squashed @ self.V.T + self.c).unbind(-1))


class Batch(NamedTuple):
    """Transitions as tensors: states before by numbers (K,), speeds after (K, n + 1)."""

    x: list[Tensor]
    u: Tensor
    h: Tensor
    after: Tensor

    @classmethod
    def of(cls, seen: Experience) -> 'Batch':
        """Take experience."""
        half = seen.X.shape[1] // 2
        return cls(list(torch.tensor(seen.X).unbind(-1)), torch.tensor(seen.U),
                   torch.tensor(seen.h), torch.tensor(seen.Y[:, half:]))

    def residuals(self, dynamics: Any) -> Tensor:
        """Return by how much the speeds after are off (K, n + 1)."""
        n = self.after.shape[1]

        def f(x: Any, u: Any) -> list[Tensor]:
            return [*x[n:], *dynamics.accelerations(x, u)]
        return self.after - torch.stack(list(rk4(f, self.x, self.u, self.h))[n:], -1)


class Scales(NamedTuple):
    """How large inputs (inputs,) and accelerations (n + 1,) are in some experience."""

    inputs: Array
    outputs: Array

    @classmethod
    def of(cls, seen: Experience) -> 'Scales':
        """Return those of experience."""
        n = seen.X.shape[1] // 2 - 1
        th, rates = np.split(seen.variables, [n], axis=1)
        change = (seen.Y - seen.X)[:, n + 1:] / seen.h[:, None]
        return cls(*(np.maximum(each.std(axis=0), 1e-3) for each in (
            np.column_stack(inputs([*np.sin(th).T], [*np.cos(th).T], [*rates.T])), change)))


def initial(links: int, hidden: int, scales: Scales, seed: int) -> Network:
    """Return a network of random hidden units, about as steep as the experience is wide."""
    random = np.random.default_rng(seed)
    W = random.normal(size=(hidden, len(scales.inputs))) / np.sqrt(len(scales.inputs))
    return Network.of(links, W / scales.inputs, random.normal(size=hidden),
                      np.zeros((links + 1, hidden)), np.zeros(links + 1))


def trained(dynamics: 'Residual | BlackBox', seen: Experience, held_out: Experience,
            on_round: Callable[[Any], object] = lambda _: None) -> Any:
    """
    Return the dynamics with a network that is trained, from the one that they have on.

    on_round is called with the dynamics after each round.
    """
    network, scales = dynamics.network, Scales.of(seen)
    of_inputs, of_outputs = (torch.tensor(each) for each in scales)
    # numbers of about one, which the optimiser takes for granted
    W, b = torch.tensor(network.W) * of_inputs, torch.tensor(network.b)
    V, c = torch.tensor(network.V) / of_outputs[:, None], torch.tensor(network.c) / of_outputs
    weights = [each.requires_grad_() for each in (W, b, V, c)]
    batch, other = Batch.of(seen), Batch.of(held_out)

    def layers() -> Any:   # what stands for a Network
        return Layers(network.widths, W / of_inputs, b, V * of_outputs[:, None], c * of_outputs)

    def fit(of: Batch) -> Tensor:
        e = of.residuals(dynamics._replace(network=layers()))
        return torch.log1p((e / (NOISE * of_outputs)) ** 2).mean()

    def loss() -> Tensor:
        optimiser.zero_grad()
        value = fit(batch) + DECAY * sum((each ** 2).mean() for each in weights)
        value.backward()
        return value
    optimiser = torch.optim.LBFGS(weights, max_iter=INNER, history_size=30,
                                  line_search_fn='strong_wolfe')
    best, kept, since = np.inf, network, 0
    for _ in range(ROUNDS):
        optimiser.step(loss)
        with torch.no_grad():
            own, error = float(fit(batch)), float(fit(other))
        present = Network.of(network.widths.links, *(
            each.detach().numpy() for each in layers()[1:]))
        on_round(dynamics._replace(network=present))
        if error < best:
            best, since, kept = error, 0, present
        else:
            since += 1
        if since >= PATIENCE or not np.isfinite(own):
            break
    return dynamics._replace(network=kept)
