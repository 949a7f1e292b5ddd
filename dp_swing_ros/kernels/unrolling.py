# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Equations written once, for any number of links, and compiled as if written out for each.

A function under `@unrolled` is plain Python: loops, lists and sums over numbers, tuples and the
elements of arrays. For arguments of given types it is run once with symbols in place of the
numbers; what it did with them, less what it did twice, becomes a function without loops or
branches. That is what runs where it is called from Python; into kernels the compiler inlines it
and turns it into vector instructions. Sizes must follow from the types of the arguments: from
tuples and constants.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
import functools
import inspect
from typing import Any

from numba import typeof, types
from numba.extending import overload
import numpy as np

from dp_swing_ros.kernels.compilation import ConstantType, OPTIONS
from dp_swing_ros.kernels.symbols import (
    ancestors, cos, Elements, flat, OPERATIONS, sin, Symbol, Trace)


@dataclass
class Program:
    """The text of a function that computes symbols, writes elements and returns a structure."""

    trace: Trace
    single: bool   # constants are of single precision; wider ones would widen all else
    lines: list[str] = field(default_factory=list)
    names: dict[Symbol, str] = field(default_factory=dict)
    constants: dict[str, Any] = field(default_factory=dict)

    def add(self, symbol: Symbol) -> None:
        """Compute a symbol whose operands are computed."""
        if symbol in self.names:
            return
        name = self.names[symbol] = f'_{len(self.names)}'
        if symbol in self.trace.calls:
            function, arguments = self.trace.calls[symbol]
            self.constants[function.__name__] = function
            given = ', '.join(map(self.text, arguments))
            self.lines.append(f'{name} = {function.__name__}({given})')
            return
        operation, operands = symbol.operation, symbol.operands
        if operation in ('sin', 'cos'):   # both at once
            s, c = (name, f'{name}o') if operation == 'sin' else (f'{name}o', name)
            self.names[sin(*operands)], self.names[cos(*operands)] = s, c
            self.lines.append(f'{s}, {c} = sincos({self.text(*operands)})')
            return
        text = OPERATIONS[operation].text if operation in OPERATIONS else operation
        self.lines.append(f'{name} = {text.format(*map(self.text, operands))}')

    def write(self, places: Iterable[str], value: Any) -> None:
        """Write a computed number to elements of arrays."""
        self.lines += [f'{place} = {self.text(value)}' for place in places]

    def text(self, value: Any) -> str:
        """Return a computed symbol, a constant or a structure of them as text."""
        if isinstance(value, Symbol):
            return self.names[value]
        if id(value) in self.trace.texts:
            return self.trace.texts[id(value)][0]
        if isinstance(value, (tuple, list)):
            inner = ''.join(f'{self.text(each)}, ' for each in value)
            if hasattr(value, '_fields'):
                self.constants[type(value).__name__] = type(value)
                return f'{type(value).__name__}({inner})'
            return f'({inner})'
        if value is None or isinstance(value, int):
            return str(value)
        number = (np.float32 if self.single else float)(value)
        name = f'c_{repr(float(number)).translate(str.maketrans("-.+", "mdp"))}'
        self.constants[name] = number
        return name


def is_tuple(kind: Any) -> bool:
    """Return whether a Numba type is one of tuples."""
    return isinstance(kind, types.BaseTuple)


def is_single(kind: Any) -> bool:
    """Return whether a Numba type has numbers of single precision."""
    if is_tuple(kind):
        return any(map(is_single, kind.types))
    return getattr(kind, 'dtype', kind) == types.float32


def argument(trace: Trace, kind: Any, text: str) -> Any:
    """Return what stands for an argument of a Numba type."""
    if isinstance(kind, types.NoneType):
        return None
    if is_tuple(kind):
        named = isinstance(kind, types.BaseNamedTuple)
        parts = [argument(trace, each, f'{text}.{kind.fields[i]}' if named else f'{text}[{i}]')
                 for i, each in enumerate(kind.types)]
        structure = kind.instance_class(*parts) if named else tuple(parts)
    elif isinstance(kind, types.Array):
        structure = Elements(trace, text)
    elif isinstance(kind, ConstantType):
        structure = kind.value
    else:
        return trace.symbol(text)
    trace.texts[id(structure)] = text, structure
    return structure


def written_out(function: Callable, kinds: Sequence[Any]) -> Callable:
    """Return the straight-line function that an unrolled one is for arguments of some types."""
    from dp_swing_ros.kernels.trigonometry import sincos   # not where the cache has all kernels

    names, trace = list(inspect.signature(function).parameters), Trace()
    result = function(*(argument(trace, kind, name) for kind, name in zip(kinds, names)))
    program = Program(trace, any(map(is_single, kinds)))
    # What is read is read before anything is written, which may be to the same memory; what is
    # written is written at once, so that few numbers wait in registers.
    needed = ancestors([*flat(result), *trace.written.values(), *trace.calls])
    places: dict[Any, list[str]] = {}
    for place, value in trace.written.items():
        places.setdefault(value, []).append(place)
    for symbol in sorted(needed, key=lambda each: (not each.is_given, each.order)):
        program.add(symbol)
        if not symbol.is_given:
            program.write(places.pop(symbol, ()), symbol)
    for value, left in places.items():
        program.write(left, value)
    lines = [*program.lines, f'return {program.text(result)}']
    text = f'def {function.__name__}({", ".join(names)}):\n' + ''.join(
        f'    {line}\n' for line in lines)
    scope = {'sincos': sincos, **program.constants}
    exec(compile(text, f'<{function.__name__} unrolled>', 'exec'), scope)
    found: Callable = scope[function.__name__]
    return found


def unrolled(function: Callable) -> Callable:
    """Make a function of numbers, tuples and elements one that kernels can call."""
    @functools.cache
    def of_types(kinds: tuple) -> Callable:
        return written_out(function, kinds)

    @functools.wraps(function)
    def run(*arguments: Any) -> Any:
        try:
            kinds = tuple(map(typeof, arguments))
        except ValueError:      # tensors and symbols have no Numba type
            return function(*arguments)
        # what an array of objects holds is not known either
        known = types.pyobject not in [getattr(kind, 'dtype', None) for kind in kinds]
        return of_types(kinds)(*arguments) if known else function(*arguments)

    @overload(run, strict=False, jit_options=OPTIONS)
    def compiled(*kinds: Any) -> Callable:
        return of_types(kinds)

    return run
