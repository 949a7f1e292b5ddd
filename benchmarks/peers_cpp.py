# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A problem for peers that are C++ libraries, number for number: step and cost in C by CasADi.

Its expressions are those of examples/acados_rti, with Gauss-Newton's Hessian. Of the peers pip has
their C++ alone, or a Python through which a step of ours would be slow, so a file of C++ poses the
problem to each (peers_problem.hpp). It is compiled where it is first needed, in some ten seconds,
for the instructions that the wheel was built for, as Eigen's memory differs with them; what CasADi
writes is compiled for those of this machine.
"""

from collections.abc import Hashable, Mapping
import ctypes
from importlib.metadata import distribution
from pathlib import Path
import shutil
import subprocess
import tempfile
from typing import Any, ClassVar
import weakref

from acados_rti.expressions import Expressions, numbers_of
import casadi as ca
import numpy as np
from peers_casadi import COMPILER, Guess
from timing import Missing

from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.problem import Problem

FOLDER = Path(__file__).parent
FLAGS = '-O2', '-fPIC', '-DNDEBUG'

_folders: list[Any] = []   # of what is loaded
_objects: dict[str, Path] = {}
_loaded: dict[Hashable, ctypes.CDLL] = {}


class Peer:
    """A solver of a C++ library for a problem; a peer says which file of C++ that is."""

    SOURCE: ClassVar[str]                  # in this folder
    DISTRIBUTION: ClassVar[str]            # whose wheel brings headers and libraries
    LIBRARIES: ClassVar[tuple[str, ...]]
    DEFINES: ClassVar[tuple[str, ...]] = ()
    OPTION: ClassVar[Any]                  # the type of the option

    @staticmethod
    def functions(e: Expressions) -> Mapping[str, list[Any]]:
        """Return by name what the C++ calls: results of x, u and the parameters p."""
        raise NotImplementedError

    def __init__(self, ours: Problem, tolerance: float, option: float | int) -> None:
        """
        Take the problem; the first of its structure is compiled.

        An option is what the peer alone has. Raises Missing where there is no compiler.
        """
        self.code, p = code(type(self), ours), numbers_of(ours.model, ours.cost)
        self.memory = self.code.create(ours.horizon, len(ours.cost.S), p.ctypes.data, len(p),
                                       *ours.bounds, tolerance, option)
        self.cost = np.zeros(1)   # of the last trajectory, as the peer counts
        weakref.finalize(self, self.code.destroy, self.memory)

    def solve(self, X: Array, U: Array, iterations: int) -> int:
        """Replace a trajectory, and return the number of iterations, -1 where it gave up."""
        return int(self.code.solve(self.memory, iterations, X.ctypes.data, U.ctypes.data,
                                   self.cost.ctypes.data))

    def trajectory(self, guess: Guess, iterations: int) -> tuple[Array, Array]:
        """Return states and forces of a whole solve, those of the guess where it gave up."""
        X, U = guess.X.copy(), guess.U.copy()
        self.solve(X, U, iterations)
        return X, U


def code(peer: type[Peer], ours: Problem) -> ctypes.CDLL:
    """Return the code for problems of this structure; raises Missing where none can be made."""
    model = ours.model
    key = (peer.SOURCE, type(model.pendulum), model.pendulum.kind, model.integrator,
           ours.cost.angle_error)
    if key not in _loaded:
        if not (COMPILER and shutil.which('c++')):
            raise Missing(f'there is no C++ compiler, which {peer.SOURCE} needs')
        _folders.append(tempfile.TemporaryDirectory())
        folder = Path(_folders[-1].name)
        if peer.SOURCE not in _objects:
            _objects[peer.SOURCE] = compiled(peer, folder)
        library = ctypes.CDLL(str(linked(peer, Expressions.of(model, ours.cost), folder)))
        pointer, number, real = ctypes.c_void_p, ctypes.c_int, ctypes.c_double
        library.create.argtypes = (
            number, number, pointer, number, real, real, real, peer.OPTION)
        library.create.restype = pointer
        library.solve.argtypes = pointer, number, pointer, pointer, pointer
        library.destroy.argtypes, library.destroy.restype = (pointer,), None
        _loaded[key] = library
    return _loaded[key]


def compiled(peer: type[Peer], folder: Path) -> Path:
    """Compile the C++ of a peer, which does not depend on the problem."""
    include = prefix(peer) / 'include'
    file = folder / 'peer.o'
    subprocess.run(['c++', '-std=c++17', *FLAGS, *(f'-D{name}' for name in peer.DEFINES), '-w',
                    f'-I{include}', f'-I{include}/eigen3', '-c', FOLDER / peer.SOURCE, '-o', file],
                   check=True)
    return file


def linked(peer: type[Peer], expressions: Expressions, folder: Path) -> Path:
    """Compile what CasADi writes of a problem, and link it with the C++ of a peer."""
    assert COMPILER is not None
    e, writer = expressions, ca.CodeGenerator('problem.c', {'casadi_int': 'int'})
    for name, results in peer.functions(e).items():
        writer.add(ca.Function(f'pendulum_{name}', [e.x, e.u, e.p],
                               [ca.densify(result) for result in results], {'cse': True}))
    writer.generate(f'{folder}/')
    libraries, file = prefix(peer) / 'lib', folder / 'problem.so'
    for command in (
            [COMPILER, *FLAGS, '-march=native', '-c', 'problem.c'],
            # found by their path, also by each other
            ['c++', '-shared', _objects[peer.SOURCE], 'problem.o', f'-L{libraries}',
             f'-Wl,--disable-new-dtags,-rpath,{libraries}',
             *(f'-l{name}' for name in peer.LIBRARIES), '-o', file]):
        subprocess.run(command, cwd=folder, check=True)
    return file


def prefix(peer: type[Peer]) -> Path:
    """Return where a wheel has its headers and libraries."""
    return Path(str(distribution(peer.DISTRIBUTION).locate_file('cmeel.prefix')))
