# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a dynamics model is: a NamedTuple of numbers and five kernels over it.

A solver's kernel calls `advance`, `expand`, `linearise` and `curvature` of this module; the type
of the model decides at compile time which implementation runs, as with functools.singledispatch.
So a new model is one file, and every solver runs on it at full speed, its compiled code kept on
disk.
"""

import functools
from typing import Any, Callable

from numba.extending import overload


def model_kernel(signature: Callable) -> Any:
    """
    Turn a signature into a function that the type of its first argument, the model, dispatches.

    Implementations are added with `@<function>.register(ModelType)`; they must name their
    arguments as the signature does, and may call kernels.
    """
    implementations: dict[Any, Callable] = {}

    @functools.wraps(signature)
    def dispatch(model: Any, *arguments: Any) -> Any:
        return implementations[type(model)](model, *arguments)

    def register(model_type: type) -> Callable:
        def add(implementation: Callable) -> Callable:
            implementations[model_type] = implementation
            return implementation
        return add

    @overload(dispatch, strict=False, jit_options={
        'error_model': 'numpy', 'forceinline': True, 'fastmath': {'contract'}})
    def choose(model: Any, *arguments: Any) -> Callable | None:
        implementation = implementations.get(getattr(model, 'instance_class', None))
        return getattr(implementation, 'py_func', implementation)

    setattr(dispatch, 'register', register)
    return dispatch


@model_kernel
def of_coefficients(model, numbers):
    """
    Return the model of the same steps for another Pendulum.

    Shapes: numbers (10,), its fields.
    """


@model_kernel
def advance(model, x, th_1, th_2, v, w_1, w_2, u):
    """
    Return the six numbers of the next state x⁺ = f(x, u).

    Scalars in and out, in the precision of the arguments, so that a loop over samples vectorises.
    """


@model_kernel
def expand(model, X, U):
    """
    Return what the derivatives need at each step of a trajectory; what, is the model's affair.

    Shapes: X (T or more, 6), U (T,).
    """


@model_kernel
def linearise(model, points, t, F):
    """
    Write F = ∂f/∂(x, u) at step t of those that `expand` returned.

    Shapes: F (6, 8), its columns being those of x, that of u, and zeros.
    """


@model_kernel
def curvature(model, points, t, costate, F, W):
    """
    Write F as `linearise` does, and W = Σ λᵢ ∂²fᵢ/∂(x, u)² for the costate λ.

    Shapes: costate (6,), W (7, 8), its rows and columns as the columns of F.
    """
