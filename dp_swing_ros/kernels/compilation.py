# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How the kernels are compiled: one decorator, a disk cache that cannot go stale, and constants.

Numba looks only at a kernel's own file to decide whether its cached machine code is current, not
at the kernels it calls. So the cache of each module lies in a folder named after its source and
those of all that it imports; all copies of the same sources share it, a checkout and what was
installed from it. Of what a kernel is given, its module need not know: tuples count by the sources
of their modules, too.

Where the processor has registers of 512 bits they are used: LLVM prefers half of each on many
processors, for the sake of older ones that lowered their clock. Numba keeps machine code for
different features apart.

What decides how a kernel is written out, as the integrator does, is a part of the types of its
arguments (`Constant`).
"""

from collections.abc import Callable
import hashlib
import inspect
import os
from pathlib import Path
import sys
import time
from typing import Any
import warnings

import llvmlite.binding
import numba
from numba import types
from numba.core.caching import _CacheLocator, FunctionCache
from numba.core.codegen import get_host_cpu_features
from numba.extending import models, NativeValue, overload, register_model, typeof_impl, unbox
import numpy as np

from dp_swing_ros.kernels.sources import digest, PACKAGE


def _subfolder(file: str) -> str:
    """Return where in the cache the kernels of a file are, whose own or another package's."""
    folder, name = Path(file).parent, Path(file).stem
    inside = folder.is_relative_to(PACKAGE)
    return os.path.join(f'numba-{numba.__version__}',
                        folder.relative_to(PACKAGE) if inside else _usual_subfolder(file),
                        f'{name}-{digest(file)}')


# Numba has a setting for it since 0.62, but that of Ubuntu is older.
_usual_subfolder = _CacheLocator.get_suitable_cache_subpath
setattr(_CacheLocator, 'get_suitable_cache_subpath', staticmethod(_subfolder))

config: Any = numba.config   # its names are made when it is imported
if not {'NUMBA_CPU_NAME', 'NUMBA_CPU_FEATURES'} & set(os.environ):
    if '+avx512f' in get_host_cpu_features().split(','):
        config.CPU_FEATURES = f'{get_host_cpu_features()},-prefer-256-bit'
# The rows of a block lie apart from each other; where there are as many as three links have, LLVM
# would rather not compare them, and leave the loops over them without vectors.
llvmlite.binding.set_option('', '-memory-check-merge-threshold=100000')
if 'NUMBA_CACHE_DIR' not in os.environ:
    config.CACHE_DIR = str(Path(
        os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / 'dp_swing_ros')

# IEEE division instead of Python's exception: a kernel reports trouble as a non-finite number.
# Always inlined into the kernels that call it: no loop vectorises with a call in it, and a kernel
# that is called has two versions, its own and the one compiled into its caller, which round
# differently. Which of them runs would depend on what came out of the cache.
# Nothing calls them from C, for which Numba would compile each once more.
OPTIONS: Any = {'error_model': 'numpy', 'forceinline': True, 'fastmath': {'contract'},
                'no_cfunc_wrapper': True}


class KernelCache(FunctionCache):
    """What tells the versions of a kernel apart: also the sources of the tuples given to it."""

    def _index_key(self, signature: Any, codegen: Any) -> tuple:
        return *super()._index_key(signature, codegen), tuple(map(_tuples_in, signature))

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep machine code on disk, if there is room."""
        try:
            super().save_overload(signature, data)
        except OSError as error:
            _not_kept(str(error))


def _not_kept(reason: str) -> None:
    warnings.warn(f'compiled kernels cannot be kept in {config.CACHE_DIR}: {reason}; each start '
                  'compiles them again, unless NUMBA_CACHE_DIR is a folder that can be written')


def _tuples_in(kind: Any) -> Any:
    """Return the fields of the named tuples in a type, and digests of what defines them."""
    inner = tuple(map(_tuples_in, getattr(kind, 'types', ())))
    if not hasattr(kind, 'instance_class'):
        return inner
    file = getattr(sys.modules.get(kind.instance_class.__module__), '__file__', None)
    return kind.fields, digest(file) if file and os.path.isfile(file) else None, inner


def kernel(function: Callable) -> Any:
    """Return a function that is compiled for the types of its arguments when it is called."""
    compiled = numba.njit(nogil=True, **OPTIONS)(function)
    if not config.DISABLE_JIT:
        try:
            compiled._cache = KernelCache(function)
        except RuntimeError:   # Numba has looked for others, too
            _not_kept('it cannot be written')
    return compiled


def processor() -> str:
    """Return which processor the kernels are compiled for: its name, a digest of its features."""
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


class ConstantType(types.Opaque):
    """The Numba type of a constant; it is known by its identity alone."""

    known: dict[str, 'Constant'] = {}

    def __init__(self, identity: str) -> None:
        """Take the identity."""
        self.identity = identity
        super().__init__(f'Constant({identity})')

    @property
    def value(self) -> 'Constant':
        """Return the constant."""
        return self.known[self.identity]


class Constant:
    """
    Something that is known when a kernel is compiled, as a part of its arguments' types.

    It decides which machine code in the cache is meant, so its identity is its name with the
    sources of its module.
    """

    def __init__(self, name: str, of: Callable) -> None:
        """Take its name, and a function of the module that defines it."""
        source = inspect.getsourcefile(of)
        version = digest(source) if source else hashlib.sha256(
            of.__code__.co_code).hexdigest()[:16]
        identity = f'{name}-{version}'
        ConstantType.known[identity] = self
        self._numba_type_ = ConstantType(identity)   # where Numba looks for it


register_model(ConstantType)(models.OpaqueModel)


@unbox(ConstantType)
def _unboxed(kind: ConstantType, value: Any, context: Any) -> NativeValue:
    return NativeValue(context.context.get_dummy_value())


def mapped(function: Callable[[Any], Any], structure: Any) -> Any:
    """Return a structure of tuples with what a function makes of all but its constants."""
    if isinstance(structure, tuple):
        parts = [mapped(function, part) for part in structure]
        return type(structure)(*parts) if hasattr(structure, '_fields') else tuple(parts)
    return structure if isinstance(structure, Constant) else function(structure)


def same_type_by(key: Callable[[Any], Any]) -> Callable[[type], type]:
    """
    Let Numba find the type of a class's instances once for each key, instead of at every call.

    The key must hold all that the type depends on; the type of a tuple of tuples takes Numba
    longer to find than a short kernel takes to run.
    """
    def register(cls: type) -> type:
        found: dict[Any, types.Type] = {}

        def type_of(value: Any, context: Any = None) -> types.Type:
            known = key(value)
            if known not in found:
                found[known] = typeof_impl.dispatch(tuple)(value, context)
            return found[known]

        def known_type_of(value: Any) -> types.Type:
            try:
                return found[key(value)]
            except KeyError:
                raise AttributeError('_numba_type_') from None

        typeof_impl.register(cls)(type_of)
        # Where Numba's dispatcher looks before it asks Python. It drops what this raises, also a
        # KeyboardInterrupt that comes meanwhile, so that what takes long has no place in it.
        setattr(cls, '_numba_type_', property(known_type_of))
        return cls
    return register
