# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How many multiply-adds the machine can do a second, and what share of them the rollouts use.

The limit is measured, not read from a data sheet, and the best of all that is measured, so nothing
exceeds it: independent chains of fused multiply-adds that stay in registers, written in LLVM's own
language so that no compiler has a choice, by number of chains, width of registers and cores; and
matrix products of NumPy's BLAS, by size. Rollouts, on one core and on all, are held against it.
operations.py counts the operations of their kernel.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
import ctypes
import json
import os
from pathlib import Path
import re
import subprocess
import sys
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from timing import Interval, median, race, ratio, Work

from dp_swing_ros.control import controllers
from dp_swing_ros.kernels import kernel
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.solvers.noise import LANES
from dp_swing_ros.solvers.samples import follow, single

# two units of four cycles need 8; 16 registers have room for 14, those of 512 bits are 32
CHAINS = {128: (8, 12), 256: (8, 10, 12, 14), 512: (8, 12, 16, 24)}
ROUNDS = 2_000_000    # of all chains in a sample, long beside the start of a thread
MATRICES = 512, 1024, 2048
TYPES = {'float32': ('float', 'f32', ctypes.c_float, 4),
         'float64': ('double', 'f64', ctypes.c_double, 8)}
SAMPLES = 8192         # many blocks, long beside the start of a thread


def program(precision: str, bits: int, chains: int) -> str:
    """Return spin(a, m, c, n) in LLVM: it does a ← a m + c on all lanes of all chains n times."""
    scalar, suffix, _, size = TYPES[precision]
    lanes = 8 * bits // (8 * 8 * size)
    vector, name = f'<{lanes} x {scalar}>', f'@llvm.fma.v{lanes}{suffix}'
    each = range(chains)

    def filled(result: str, value: str) -> str:
        return (f'%{result}_0 = insertelement {vector} undef, {scalar} {value}, i32 0\n'
                f'%{result} = shufflevector {vector} %{result}_0, {vector} undef, '
                f'<{lanes} x i32> zeroinitializer')
    lines = [
        f'declare {vector} {name}({vector}, {vector}, {vector})',
        f'define {scalar} @spin({scalar} %first, {scalar} %factor, {scalar} %more, i64 %n) #0 {{',
        'begin:', filled('m', '%factor'), filled('c', '%more'),
        *(f'%k{i} = uitofp i64 {i} to {scalar}\n%f{i} = fadd {scalar} %first, %k{i}\n'
          + filled(f'a{i}', f'%f{i}') for i in each),
        'br label %loop', 'loop:', '%t = phi i64 [0, %begin], [%next, %loop]',
        *(f'%x{i} = phi {vector} [%a{i}, %begin], [%y{i}, %loop]' for i in each),
        *(f'%y{i} = call {vector} {name}({vector} %x{i}, {vector} %m, {vector} %c)' for i in each),
        '%next = add i64 %t, 1', '%done = icmp eq i64 %next, %n',
        'br i1 %done, label %end, label %loop', 'end:', f'%s0 = fadd {vector} %y0, %y0',
        *(f'%s{i} = fadd {vector} %s{i - 1}, %y{i}' for i in each[1:]),
        f'%result = extractelement {vector} %s{chains - 1}, i32 0', f'ret {scalar} %result', '}',
        f'attributes #0 = {{ "prefer-vector-width"="{bits}" "min-legal-vector-width"="{bits}" }}']
    return '\n'.join(lines)


class Spinner:
    """The program, compiled; its work is counted in multiply-adds."""

    def __init__(self, precision: str, bits: int, chains: int) -> None:
        """Compile, and refuse code that does not use registers of these bits."""
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        module = llvm.parse_assembly(program(precision, bits, chains))
        target = llvm.Target.from_default_triple().create_target_machine(
            cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=3)
        register = {128: 'xmm', 256: 'ymm', 512: 'zmm'}[bits]
        fused = re.findall(rf'\bvf\w*madd\w+\s.*%{register}|fmla', target.emit_assembly(module))
        if len(fused) != chains:
            raise RuntimeError(f'{len(fused)} fused multiply-adds of {bits} bits; '
                               f'expected {chains}')
        self.engine = llvm.create_mcjit_compiler(module, target)   # owns the code
        self.engine.finalize_object()
        number = TYPES[precision][2]
        self.spin = ctypes.CFUNCTYPE(number, number, number, number, ctypes.c_int64)(
            self.engine.get_function_address('spin'))
        self.multiply_adds = ROUNDS * chains * bits // (8 * TYPES[precision][3])

    def run(self) -> int:
        """Do the work."""
        self.spin(1.0, 0.999, 0.001, ROUNDS)
        return self.multiply_adds


def widest() -> int:
    """Return the bits of the widest registers of this processor."""
    features = llvm.get_host_cpu_features()
    return 512 if features.get('avx512f') else 256 if features.get('avx2') else 128


def shared(works: Sequence[Work], pool: ThreadPoolExecutor) -> Work:
    """Return all works at once, each on a core of its own; their units add up."""
    if len(works) == 1:
        return works[0]
    return lambda: sum(done.result() for done in [pool.submit(work) for work in works])


def product(precision: str, size: int) -> Work:
    """Return a product of two matrices by NumPy's BLAS, on as many threads as that takes."""
    A = np.random.default_rng(0).standard_normal((size, size)).astype(precision)
    out = np.empty_like(A)

    def run() -> int:
        np.dot(A, A, out=out)
        return size ** 3
    return run


def rollouts(problem: Problem, samples: int = SAMPLES) -> Work:
    """Return the rollout kernel of MPPI on noise that is there already; units are its steps."""
    N, blocks = problem.horizon, -(-samples // LANES)
    noise = np.random.default_rng(0).standard_normal((N, LANES), np.float32)
    V, J = np.empty((blocks, N, LANES), np.float32), np.empty((blocks, LANES), np.float32)
    x_0, offsets = hanging().astype(np.float32), np.zeros(N, np.float32)
    gains, sigma = np.zeros((N, len(x_0)), np.float32), np.full(LANES, 5, np.float32)
    model, cost = single(problem.model), single(problem.cost)

    def run() -> int:
        follow_all(model, cost, x_0, offsets, gains, noise, sigma, single(problem.bounds), V, J)
        return N * LANES * blocks
    return run


@kernel
def follow_all(model, cost, x_0, offsets, gains, noise, sigma, bounds, V, J):
    """Follow many blocks of samples, all on the same noise."""
    scratch = np.empty((len(x_0) + 3, LANES), np.float32)
    for block in range(len(V)):
        follow(model, cost, x_0, offsets, gains, noise, sigma, np.float32(0.8), bounds, scratch,
               V[block], J[block])


def operations() -> dict[str, dict[str, float]]:
    """Return the counts of operations.py, which needs a process without a compiler."""
    done = subprocess.run([sys.executable, str(Path(__file__).with_name('operations.py'))],
                          env={**os.environ, 'NUMBA_DISABLE_JIT': '1'}, capture_output=True,
                          text=True, check=True)
    counts: dict[str, dict[str, float]] = json.loads(done.stdout)
    return counts


def measure(rounds: int) -> dict[str, Any]:
    """Return the limits, our rates, and the share, as numbers for the page."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count()
    assert cores is not None
    problem = controllers.problem({})
    with ThreadPoolExecutor(cores) as pool:
        contenders = machine_works(cores, pool)
        ours = {spread_over(number, cores, 'rollouts'): shared(
            [rollouts(problem) for _ in range(number)], pool) for number in sorted({1, cores})}
        times = race({**ours, **contenders}, rounds)
        rates = {name: 1 / median(of_name).value for name, of_name in times.items()}
        limit, best = limit_of(rates), max(ours, key=rates.__getitem__)
    counts = operations()
    each = sum(counts['sample'].values())
    scale = each / 2   # a multiply-add is two operations
    return {'rates': rates, 'operations': counts, 'per_step': each, 'limit': limit, 'best': best,
            'least': {samples: scale * samples * problem.horizon / rates[limit]
                      for samples in (1024, 8192)},
            'share': Interval(*(scale * number for number in ratio(times[limit], times[best])))
            ._asdict()}


def limit_of(rates: Mapping[str, float]) -> str:
    """Return which of all that compute in single precision has the highest rate."""
    return max((name for name in rates if name.startswith('float32')), key=rates.__getitem__)


def machine_works(cores: int, pool: ThreadPoolExecutor) -> dict[str, Work]:
    """Return what may reach the limit."""
    works: dict[str, Work] = {}
    for precision in TYPES:
        for bits in sorted({256, widest()} if widest() > 256 else {widest()}):
            for chains in CHAINS[bits]:
                spinner = Spinner(precision, bits, chains)
                for number in sorted({1, cores}):
                    works[spread_over(number, cores, f'{precision}, {chains} chains of {bits} bits'
                                      )] = shared([spinner.run] * number, pool)
        for size in MATRICES:
            works[f'{precision}, matrix product of {size}'] = product(precision, size)
    return works


def spread_over(number: int, cores: int, name: str) -> str:
    """Return the name of a work on some of the cores."""
    return f'{name}, {number} of {cores} cores'


if __name__ == '__main__':
    print(json.dumps(measure(20), indent=1))
