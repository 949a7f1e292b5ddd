# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How the kernels are compiled: one decorator, and a disk cache that cannot go stale.

Numba looks only at a kernel's own file to decide whether its cached machine code is current, not
at the kernels it calls. So the cache lies in a folder named after the sources of all kernels.

Where the processor has registers of 512 bits they are used: LLVM prefers half of each on many
processors, for the sake of older ones that lowered their clock. Numba keeps machine code for
different features apart.
"""

import hashlib
import os
from pathlib import Path
import time
from typing import Any, Callable

import llvmlite.binding
import numba
from numba import types
from numba.core.codegen import get_host_cpu_features
from numba.extending import overload
import numpy as np


def _cache_folder() -> Path:
    package = Path(__file__).parents[1]
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(package.rglob('*.py')):
        text = source.read_bytes()
        if b'kernel' in text:
            digest.update(text)
    home = Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache')
    return home / 'dp_swing_ros' / digest.hexdigest()[:16]


def _widest_features() -> str | None:
    """Return the features to compile for, None for what Numba finds by itself."""
    features: str = get_host_cpu_features()
    return f'{features},-prefer-256-bit' if '+avx512f' in features.split(',') else None


if not {'NUMBA_CPU_NAME', 'NUMBA_CPU_FEATURES'} & set(os.environ):
    setattr(numba.config, 'CPU_FEATURES', _widest_features())

if 'NUMBA_CACHE_DIR' not in os.environ:
    setattr(numba.config, 'CACHE_DIR', str(_cache_folder()))

# IEEE division instead of Python's exception: a kernel reports trouble as a non-finite number.
# Always inlined into the kernels that call it: no loop vectorises with a call in it, and a kernel
# that is called has two versions, its own and the one compiled into its caller, which round
# differently. Which of them runs would depend on what came out of the cache.
kernel = numba.njit(cache=True, nogil=True, error_model='numpy', forceinline=True,
                    fastmath={'contract'})


def processor() -> str:
    """Return which processor the kernels are compiled for: its name, a digest of its features."""
    config: Any = numba.config   # its names are made when it is imported
    if config.DISABLE_JIT:
        return 'interpreted'
    name = config.CPU_NAME or llvmlite.binding.get_host_cpu_name()
    features = config.CPU_FEATURES
    if features is None:
        features = get_host_cpu_features()
    return f'{name}-{hashlib.sha256(features.encode()).hexdigest()[:8]}'


_clock_gettime: Any = types.ExternalFunction(
    'clock_gettime', types.int32(types.int32, types.voidptr))


def now() -> float:
    """Return the time [s] of a clock that is never set; only differences mean something."""
    return time.perf_counter()


@overload(now)
def _now() -> Callable[[], float]:
    clock = time.CLOCK_MONOTONIC

    def read():
        seconds = np.empty(2, np.int64)   # and nanoseconds
        _clock_gettime(clock, seconds.ctypes)
        return seconds[0] + 1e-9 * seconds[1]
    return read
