# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled code: the same numbers whether it comes out of the cache or not; its clock."""

import errno
import os
from pathlib import Path
import shutil
import subprocess
import sys
import time
from typing import NamedTuple

import numba
import pytest

import dp_swing_ros
from dp_swing_ros.kernels import compilation, kernel, now, processor
from dp_swing_ros.kernels.compilation import same_type_by

SOLVES = """
import hashlib, math, numpy as np
import dp_swing_ros
from dp_swing_ros.control import controllers
from dp_swing_ros.kernels import processor
from dp_swing_ros.solvers import SOLVERS
problem, plans = controllers.problem({'links': 1}), hashlib.sha256()  # compiles sooner
solver, random = SOLVERS['ilqr'], np.random.default_rng(0)
one = solver(problem, solver.Parameters())
for _ in range(10):
    plan = one.solve(random.uniform(-3, 3, 4), None, math.inf)
    plans.update(plan.U.tobytes() + plan.K.tobytes())
print(plans.hexdigest(), processor(), *dp_swing_ros.__path__)
"""


def test_what_the_cache_holds_computes_to_the_bit_what_was_compiled(tmp_path):
    """So that a bag of a first start is repeated by a second, and by a copy of the sources."""
    here, copy, cache = Path(dp_swing_ros.__file__).parent, tmp_path / 'copy', tmp_path / 'cache'
    shutil.copytree(here, copy / here.name)

    def solved(sources):
        printed = subprocess.run(
            [sys.executable, '-c', SOLVES], capture_output=True, text=True, check=True,
            cwd=tmp_path,   # for Python looks there first
            env={**os.environ, 'NUMBA_CACHE_DIR': str(cache), 'PYTHONPATH': str(sources)}).stdout
        digest, compiled_for, imported = printed.split()
        assert (compiled_for, imported) == (processor(), str(sources / here.name))
        return digest, {file: file.stat().st_mtime_ns for file in cache.rglob('*.nbc')}
    first, compiled = solved(here.parent)
    assert compiled
    assert solved(copy) == (first, compiled)


@kernel
def until(seconds):
    began = now()
    while now() - began < seconds:
        pass
    return now() - began


def test_where_nothing_can_be_kept_a_kernel_runs_all_the_same(monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, 'No space left on device')
    monkeypatch.setattr(compilation.KernelCache, '_save_overload', full)
    with pytest.warns(UserWarning, match='No space left on device; .* unless NUMBA_CACHE_DIR'):
        assert kernel(twice)(3) == 6

    def read_only(*_):
        raise RuntimeError('no locator available')
    monkeypatch.setattr(compilation, 'KernelCache', read_only)
    with pytest.warns(UserWarning, match='it cannot be written; each start compiles them again'):
        again = kernel(twice)
    assert again(3) == 6


def twice(x):
    return 2 * x


def test_a_kernel_s_clock_goes_as_python_s():
    until(0.0)
    began = time.perf_counter()
    inside = until(0.05)
    assert 0.05 <= inside <= time.perf_counter() - began


def test_the_processor_is_that_of_the_features_compiled_for():
    script = ('import numba; from dp_swing_ros.kernels import processor; print(processor())\n'
              'numba.config.DISABLE_JIT = False; print(processor())')
    told = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True,
                          check=True, env={**os.environ, 'NUMBA_DISABLE_JIT': '1',
                                           'NUMBA_CPU_FEATURES': '+sse2'}).stdout.split()
    assert told[0] == 'interpreted' and told[1] not in ('interpreted', processor())


def test_an_interrupt_is_not_lost_while_numba_finds_a_type():
    class Part:
        interrupted = False

    @numba.extending.typeof_impl.register(Part)
    def _(part, context):
        if not part.interrupted:
            part.interrupted = True
            raise KeyboardInterrupt
        return numba.types.none

    @same_type_by(lambda whole: len(whole))
    class Whole(NamedTuple):
        part: Part

    @numba.njit
    def takes(whole):
        return 3

    whole = Whole(Part())
    with pytest.raises(KeyboardInterrupt):
        takes(whole)
    assert takes(whole) == takes(whole) == 3
