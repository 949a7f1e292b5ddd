# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
aligator's ProxDDP on the same problems, number for number.

pip has its C++ library and no Python of it, so peers_aligator.cpp poses the problem: step and cost
in C that CasADi writes, of the expressions of examples/acados_rti, with Gauss-Newton's Hessian;
the bound is a constraint. It is compiled where it is first needed, in some ten seconds. What is
C++ has the instructions that the wheel was built for, as Eigen's memory differs with them.

Settings: those of aligator's own examples, linear rollouts and one thread, as ours; of the first
penalties from 1e-2 to 1e-8 that these have, the ones that are fastest and most often right here.

Source: Jallet, Bambade, Arlaud, El-Kazdadi, Mansard and Carpentier, "ProxDDP: proximal constrained
trajectory optimization", IEEE Transactions on Robotics 41, 2025.
"""

from collections.abc import Callable, Hashable
import ctypes
from importlib.metadata import distribution
from pathlib import Path
import shutil
import subprocess
import tempfile
from typing import Any
import weakref

from acados_rti.expressions import Expressions, numbers_of
import casadi as ca
import numpy as np
from peers_casadi import COMPILER, Guess, TOLERANCE
from peers_gradient import first_plan, problem, STARTS
from timing import Missing, Work

from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.problem import Problem

SOURCE = Path(__file__).with_suffix('.cpp')
PENALTY, PENALTY_OF_SOLVES = 1e-4, 1e-6   # μ of an iteration, and of whole solves

_folders: list[Any] = []   # of what is loaded
_loaded: dict[Hashable, ctypes.CDLL] = {}


def functions(ours: Problem) -> list[Any]:
    """Return what peers_aligator.cpp calls, as functions of CasADi."""
    e = Expressions.of(ours.model, ours.cost)
    z, n = ca.vertcat(e.x, e.u), e.x.numel()
    force_last = [*range(1, n + 1), 0]
    return [ca.Function(f'pendulum_{name}', [e.x, e.u, e.p], [ca.densify(result)], {'cse': True})
            for name, result in {
                'step': e.step, 'step_jac': ca.jacobian(e.step, z),
                'running': e.running.value, 'running_jac': ca.gradient(e.running.value, z),
                'running_hess': e.running.hessian[force_last, force_last],
                'terminal': e.terminal.value, 'terminal_jac': ca.gradient(e.terminal.value, z),
                'terminal_hess': ca.diagcat(e.terminal.hessian, 0)}.items()]


def code(ours: Problem) -> ctypes.CDLL:
    """Return the code for problems of this structure; raises Missing where none can be made."""
    structure = ours.model.integrator, ours.cost.angle_error
    if structure not in _loaded:
        _folders.append(tempfile.TemporaryDirectory())
        library = ctypes.CDLL(str(compiled(ours, Path(_folders[-1].name))))
        number, pointer, real = ctypes.c_int, ctypes.c_void_p, ctypes.c_double
        for function, result, arguments in (
                (library.create, pointer,
                 (number, number, pointer, number, real, real, real, real)),
                (library.solve, number, (pointer, number, pointer, pointer, pointer)),
                (library.destroy, None, (pointer,))):
            function.restype, function.argtypes = result, arguments
        _loaded[structure] = library
    return _loaded[structure]


def compiled(ours: Problem, folder: Path) -> Path:
    """Compile the code for a problem in a folder; raises Missing."""
    if not (COMPILER and shutil.which('c++')):
        raise Missing('there is no C++ compiler, which aligator needs')
    writer = ca.CodeGenerator('problem.c', {'casadi_int': 'int'})
    for function in functions(ours):
        writer.add(function)
    writer.generate(f'{folder}/')
    prefix = distribution('libaligator').locate_file('cmeel.prefix')
    for command in (
            [COMPILER, '-O2', '-march=native', '-fPIC', '-c', 'problem.c'],
            ['c++', '-std=c++17', '-O2', '-DNDEBUG', '-DALIGATOR_ENABLE_TEMPLATE_INSTANTIATION',
             '-w', '-shared', '-fPIC', f'-I{prefix}/include', f'-I{prefix}/include/eigen3',
             SOURCE, 'problem.o', f'-L{prefix}/lib', '-laligator', f'-Wl,-rpath,{prefix}/lib',
             '-o', 'problem.so']):
        subprocess.run(command, cwd=folder, check=True)
    return folder / 'problem.so'


class ProxDDP:
    """aligator's solver of a problem."""

    def __init__(self, ours: Problem, penalty: float) -> None:
        """Take the problem; the first of its structure is compiled. Raises Missing."""
        self.code, p = code(ours), numbers_of(ours.model, ours.cost)
        self.memory = self.code.create(ours.horizon, len(ours.cost.S), p.ctypes.data, len(p),
                                       *ours.bounds, TOLERANCE, penalty)
        self.cost = np.zeros(1)   # of the last trajectory, as aligator counts
        weakref.finalize(self, self.code.destroy, self.memory)

    def solve(self, X: Array, U: Array, iterations: int) -> int:
        """Replace a trajectory, and return the number of iterations, -1 where it gave up."""
        return int(self.code.solve(self.memory, iterations, X.ctypes.data, U.ctypes.data,
                                   self.cost.ctypes.data))


def descent(ours: Problem, start: str) -> Work:
    """Return a descent; its units are iterations."""
    solver, plan = ProxDDP(ours, PENALTY), first_plan(ours, start)
    return lambda: solver.solve(plan.X.copy(), plan.U.copy(), STARTS[start][1])


def descents(start: str, models: tuple[str, ...] = ('rk4', 'euler')) -> dict[str, Work]:
    """Return the contenders from a start."""
    return {f'aligator ProxDDP {model} 20 N': descent(problem(model, True), start)
            for model in models}


def solves(ours: Problem) -> Callable[[Guess, bool, int], Callable[[], Array]]:
    """Return whole solves; see `peers_solvers`."""
    solver = ProxDDP(ours, PENALTY_OF_SOLVES)

    def make(guess: Guess, warm: bool, count: int) -> Callable[[], Array]:
        def solve() -> Array:
            X, U = guess.X.copy(), guess.U.copy()
            solver.solve(X, U, count)
            return U
        return solve
    return make
