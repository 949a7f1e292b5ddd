# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The problem as C code, written by CasADi and acados, compiled once, and kept.

    min Σ ℓ(x_t, u_t) + ℓ_f(x_N)   s.t.   x_{t+1} = f(x_t, u_t),   u_min ≤ u_t ≤ u_max

For acados that is discrete dynamics, and an external cost with Gauss-Newton's Hessian. Source:
Verschueren et al., "acados: a modular open-source framework for fast embedded optimal control",
Mathematical Programming Computation 14, 2022.
"""

from collections.abc import Hashable, Mapping
import contextlib
import ctypes
import hashlib
from importlib.metadata import version
import io
import os
from pathlib import Path
import shutil
import subprocess
import tempfile
from typing import Any
import weakref

from acados_rti.expressions import Expressions, numbers_of
import casadi as ca
import numba
import numpy as np

from dp_swing_ros.kernels.compilation import processor
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.problem import Problem

ITERATION = Path(__file__).with_name('iteration.c')
FLAGS = '-O2', '-march=native', '-fPIC', '-shared'
LIBRARIES = 'acados', 'hpipm', 'blasfeo', 'qpOASES_e'   # each needs those after it
RTI = {'nlp_solver_type': 'SQP_RTI'}
UNBOUNDED = 1e10   # from where on acados takes a bound for none

_loaded: dict[Hashable, ctypes.CDLL] = {}
_unused: dict[Hashable, list[int]] = {}   # memory of solvers


class Acados:
    """A solver of acados for a problem, in memory that the next one of its size takes over."""

    def __init__(self, problem: Problem, blocks: int, options: Mapping[str, Any] = RTI) -> None:
        """
        Make it, its horizon condensed to so many blocks; the first of a structure is compiled.

        Raises ParameterError where acados or a C compiler is missing.
        """
        N, p = problem.horizon, numbers_of(problem.model, problem.cost)
        self.code = library(problem, options)
        # to make one takes as long as to solve, and with other masses there is a new one each tick
        unused = _unused.setdefault((self.code, N, blocks), [])
        self.memory = unused.pop() if unused else self.code.create(N, min(blocks, N))
        if self.memory is None:
            raise MemoryError(f'acados makes no solver over a horizon of {N} steps')
        weakref.finalize(self, unused.append, self.memory)
        self.code.set_problem(self.memory, N, p.ctypes.data,
                              *np.clip(problem.bounds, -UNBOUNDED, UNBOUNDED))

    def iterate(self, X: Array, U: Array) -> int:
        """Replace a trajectory, X (N + 1, 2n + 2) and U (N,), and return acados's status."""
        return int(self.code.iterate(self.memory, len(U), X.ctypes.data, U.ctypes.data))

    def cost(self) -> float:
        """Return what the last trajectory costs, as acados counts."""
        return float(self.code.cost(self.memory))


def library(problem: Problem, options: Mapping[str, Any] = RTI) -> ctypes.CDLL:
    """
    Return the code of iteration.c for problems of this structure, with options of acados.

    Horizon, bounds and the numbers of model and cost are arguments of what it creates, so only
    another structure (links, integrator, error of an angle, ...) is other code. That is compiled
    in some seconds, once; other processes load it. Raises ParameterError where acados or a
    compiler is missing.
    """
    model, cost = problem.model, problem.cost
    structure = (type(model.pendulum), model.pendulum.kind, model.integrator, cost.angle_error)
    key = (*structure, *options.items())
    if key not in _loaded:
        acados()   # or the error that says that it is missing
        _loaded[key] = load(compiled(Expressions.of(model, cost), options))
    return _loaded[key]


def load(file: Path) -> ctypes.CDLL:
    """Load compiled code, with what it needs of acados, which nobody else is to find."""
    code = ctypes.CDLL(str(file))
    number, pointer, real = ctypes.c_int, ctypes.c_void_p, ctypes.c_double
    for function, result, arguments in (
            (code.create, pointer, (number, number)),
            (code.set_problem, None, (pointer, number, pointer, real, real)),
            (code.iterate, number, (pointer, number, pointer, pointer)),
            (code.cost, real, (pointer,))):
        function.restype, function.argtypes = result, arguments
    return code


def acados() -> Any:
    """Return the package that pip installs; raises ParameterError where it is missing."""
    try:
        import acados
    except ModuleNotFoundError:
        raise ParameterError('the solver acados_rti needs acados, which is not installed; see the '
                             'README of its package') from None
    return acados


def compiled(expressions: Expressions, options: Mapping[str, Any]) -> Path:
    """Return the compiled code of a problem, which is made where it is not in the cache."""
    made_of = (ca.Function('all', [expressions.x, expressions.u, expressions.p],
                           [expressions.step, *expressions.running, *expressions.terminal]
                           ).serialize(), dict(options), FLAGS, ITERATION.read_text(), processor(),
               acados().LIB_DIR, version('comma-deps-acados'), version('casadi'))
    digest = hashlib.sha256(repr(made_of).encode()).hexdigest()[:16]
    file = Path(numba.config.CACHE_DIR) / 'acados_rti' / f'{digest}.so'
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent) as folder:
            write(expressions, options, Path(folder))
            os.replace(compile_in(Path(folder)), file)   # whole, whoever else makes it
    return file


def write(expressions: Expressions, options: Mapping[str, Any], folder: Path) -> None:
    """Let acados write its C code into a folder."""
    package = acados()
    os.environ.update({   # where acados looks for its own parts
        'ACADOS_SOURCE_DIR': package.DIR, 'ACADOS_PYTHON_INTERFACE_PATH': package.TEMPLATE_DIR,
        'TERA_PATH': package.TERA_PATH})
    from acados import acados_template as template

    running, terminal = expressions.running, expressions.terminal
    with contextlib.redirect_stdout(io.StringIO()):   # it talks
        ocp = template.AcadosOcp()
        ocp.code_export_directory, ocp.dims.N = str(folder), 1   # and any other when it is created
        model = ocp.model
        model.name, model.x, model.u, model.p = 'pendulum', *expressions[:3]
        model.disc_dyn_expr = expressions.step
        ocp.cost.cost_type = ocp.cost.cost_type_e = 'EXTERNAL'
        model.cost_expr_ext_cost, model.cost_expr_ext_cost_custom_hess = running
        model.cost_expr_ext_cost_e, model.cost_expr_ext_cost_custom_hess_e = terminal
        ocp.parameter_values = ca.DM.zeros(model.p.shape).full().ravel()
        ocp.constraints.x0 = ca.DM.zeros(model.x.shape).full().ravel()
        ocp.constraints.idxbu, ocp.constraints.lbu, ocp.constraints.ubu = map(
            np.array, ([0], [-1.0], [1.0]))
        for name, value in {'integrator_type': 'DISCRETE', 'tf': 1.0, **options}.items():
            setattr(ocp.solver_options, name, value)
        template.AcadosOcpSolver.generate(ocp, json_file=str(folder / 'problem.json'))


def compile_in(folder: Path) -> Path:
    """Compile the C code in a folder; raises ParameterError where that is not possible."""
    compiler = shutil.which('cc')
    if compiler is None:
        raise ParameterError('the solver acados_rti compiles C code, and there is no C compiler; '
                             'install one, as by apt-get install gcc')
    sources = [*folder.glob('acados_solver_*.c'), *folder.glob('*_cost/*.c'),
               *folder.glob('*_model/*_fun.c'), *folder.glob('*_model/*_jac.c')]
    include, libraries = Path(acados().INCLUDE_DIR), acados().LIB_DIR
    done = subprocess.run(
        [compiler, *FLAGS, *map(str, sources), str(ITERATION), f'-I{folder}', *(
            f'-I{each}' for each in (include, include / 'acados', include / 'blasfeo/include',
                                     include / 'hpipm/include')),
         # found by their path, also by each other; loaded for all, torch takes them for its own
         f'-L{libraries}', f'-Wl,--disable-new-dtags,-rpath,{libraries},--no-as-needed',
         *(f'-l{name}' for name in LIBRARIES), '-o', 'solver.so'],
        cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise ParameterError(f'the C code of acados_rti does not compile: {done.stderr[-2000:]}')
    return folder / 'solver.so'
