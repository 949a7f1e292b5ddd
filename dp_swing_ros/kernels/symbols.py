# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Symbols: what stands for the numbers of an equation that is to become a kernel.

A trace keeps each operation once, so what a function does twice is computed once. Symbols can be
differentiated too (`gradient`), so that nobody has to do it by hand. Source: Griewank and Walther,
Evaluating Derivatives, 2008, 3.2 (the reverse mode).
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
import inspect
from typing import Any, NamedTuple

import numpy as np


class Symbol:
    """A number that is not known yet: how it is computed, and from what."""

    __slots__ = ('trace', 'operation', 'operands', 'order')

    def __init__(self, trace: 'Trace', operation: str, operands: tuple) -> None:
        """Keep its place in the trace; the operation of what is given is its text."""
        self.trace, self.operation, self.operands = trace, operation, operands
        self.order = len(trace.symbols)

    @property
    def is_given(self) -> bool:
        """Return whether it is an argument, or is read from one."""
        return not self.operands

    def __add__(self, other: Any) -> Any:
        if is_constant(other, 0):
            return self
        if isinstance(other, Symbol) and other.operation == 'neg':
            return self - other.operands[0]
        return self.trace.symbol('+', self, other)

    def __radd__(self, other: Any) -> Any:
        return self + other

    def __sub__(self, other: Any) -> Any:
        if is_constant(other, 0):
            return self
        if isinstance(other, Symbol) and other.operation == 'neg':
            return self + other.operands[0]
        return self.trace.symbol('-', self, other)

    def __rsub__(self, other: Any) -> Any:
        return -self if is_constant(other, 0) else self.trace.symbol('-', other, self)

    def __neg__(self) -> Any:
        return self.operands[0] if self.operation == 'neg' else self.trace.symbol('neg', self)

    def __mul__(self, other: Any) -> Any:
        if is_constant(other, 0):
            return 0.0
        if is_constant(other, 1):
            return self
        if is_constant(other, -1):
            return -self
        if self.operation == 'neg':
            return -(self.operands[0] * other)
        if isinstance(other, Symbol) and other.operation == 'neg':
            return -(self * other.operands[0])
        return self.trace.symbol('*', self, other)

    def __rmul__(self, other: Any) -> Any:
        return self * other

    def __truediv__(self, other: Any) -> Any:
        return self * (1 / other)

    def __rtruediv__(self, other: Any) -> Any:
        reciprocal = self.trace.symbol('/', 1.0, self)
        return reciprocal if is_constant(other, 1) else other * reciprocal


@dataclass
class Elements:
    """An array whose elements are symbols: read where asked for, written when all is computed."""

    trace: 'Trace'
    text: str   # what the array is called

    def __getitem__(self, index: Any) -> Symbol:
        text = self.at(index)
        if text in self.trace.written:
            raise ValueError(f'{text} is read after it was written')
        return self.trace.symbol(text)

    def __setitem__(self, index: Any, value: Any) -> None:
        self.trace.written[self.at(index)] = value

    def at(self, index: Any) -> str:
        """Return the text of an element; indices are whole numbers or arguments."""
        indices = [each.operation if isinstance(each, Symbol) else str(each)
                   for each in (index if isinstance(index, tuple) else (index,))]
        return f'{self.text}[{", ".join(indices)}]'


def is_constant(value: Any, number: float) -> bool:
    """Return whether a value is known, and this number."""
    return not isinstance(value, Symbol) and value == number


@dataclass
class Trace:
    """What a function did with its symbols, each operation once."""

    symbols: dict[tuple, Symbol] = field(default_factory=dict)
    written: dict[str, Any] = field(default_factory=dict)
    calls: dict[Symbol, tuple[Callable, tuple]] = field(default_factory=dict)
    # of structures that are arguments, by id
    texts: dict[int, tuple[str, Any]] = field(default_factory=dict)

    def symbol(self, operation: str, *operands: Any) -> Symbol:
        """Return the symbol of an operation, the same for the same operands."""
        if operation in '+*' and isinstance(operands[1], Symbol) and (
                not isinstance(operands[0], Symbol) or operands[1].order < operands[0].order):
            operands = operands[::-1]
        key = (operation, *(id(each) if isinstance(each, Symbol) else float(each)
                            for each in operands))
        if key not in self.symbols:
            self.symbols[key] = Symbol(self, operation, operands)
        return self.symbols[key]


def flat(value: Any) -> list[Any]:
    """Return the numbers of a structure in order."""
    return [each for part in value for each in flat(part)] if isinstance(
        value, (tuple, list)) else [value]


def called(function: Callable, count: int, *arguments: Any) -> list[Any]:
    """
    Call an unrolled function that returns so many numbers, in a trace by a call.

    What is called is compiled once for all calls, and cannot be differentiated.
    """
    given = [each for each in flat(arguments) if isinstance(each, Symbol)]
    if not given:
        return list(inspect.unwrap(function)(*arguments))
    trace = given[0].trace
    call = trace.symbol(f'call {len(trace.calls)}', *given)
    trace.calls[call] = function, arguments
    return [trace.symbol(f'{{}}[{i}]', call) for i in range(count)]


def sin(x: Any) -> Any:
    """Return the sine of a number, a symbol, an array or a tensor."""
    if isinstance(x, Symbol):
        return x.trace.symbol('sin', x)
    return x.sin() if hasattr(x, 'sin') else np.sin(x)


def cos(x: Any) -> Any:
    """Return the cosine, likewise."""
    if isinstance(x, Symbol):
        return x.trace.symbol('cos', x)
    return x.cos() if hasattr(x, 'cos') else np.cos(x)


def clamp(x: Any, low: Any, high: Any) -> Any:
    """Return x, or the bound on its side where it is beyond, likewise."""
    if isinstance(x, Symbol):
        return x.trace.symbol('clamp', x, low, high)
    return x.clamp(low, high) if hasattr(x, 'clamp') else np.clip(x, low, high)


def is_nonzero(x: Any) -> Any:
    """Return 1 where x is not zero and 0 where it is, as a number."""
    return x.trace.symbol('is_nonzero', x, 1.0, 0.0) if isinstance(x, Symbol) else 1.0 * (x != 0)


def fixed(x: Any) -> Any:
    """Return x, which a gradient takes for a constant."""
    return x.trace.symbol('fixed', x) if isinstance(x, Symbol) else x


def total(numbers: Sequence[Any]) -> Any:
    """Return a sum, by halves: what can be added at the same time does not wait."""
    if len(numbers) < 2:
        return numbers[0] if len(numbers) > 0 else 0.0
    middle = (len(numbers) + 1) // 2
    return total(numbers[:middle]) + total(numbers[middle:])


def dot(a: Iterable[Any], b: Iterable[Any]) -> Any:
    """Return the sum of the products."""
    return total([a_i * b_i for a_i, b_i in zip(a, b)])


class Operation(NamedTuple):
    """An operation: its text, of the texts of its operands, and its derivatives by them."""

    text: str
    partials: Callable[..., tuple[Any, ...]] | None = None   # of the result and the operands


OPERATIONS: dict[str, Operation] = {   # sines and cosines are written out in pairs
    '+': Operation('{} + {}', lambda y, a, b: (1.0, 1.0)),
    '-': Operation('{} - {}', lambda y, a, b: (1.0, -1.0)),
    '*': Operation('{} * {}', lambda y, a, b: (b, a)),
    '/': Operation('{} / {}', lambda y, one, a: (None, -(y * y))),
    'neg': Operation('-{}', lambda y, a: (-1.0,)),
    'sin': Operation('sin({})', lambda y, a: (cos(a),)),
    'cos': Operation('cos({})', lambda y, a: (-sin(a),)),
    'fixed': Operation('{}', lambda y, a: (0.0,)),
    # beyond its bounds a clamp has no slope, but what is clamped here has none there either
    'clamp': Operation('min(max({}, {}), {})', lambda y, a, low, high: (1.0, None, None)),
    'is_nonzero': Operation('{1} if {0} != {2} else {2}')}


def gradient(y: Any, x: Sequence[Any]) -> list[Any]:
    """Return the derivatives of a symbol by others, in the reverse mode."""
    terms: dict[Any, list[Any]] = {y: [1.0]}   # of the adjoint of each symbol
    for each in sorted(ancestors([y]), key=lambda one: one.order, reverse=True):
        if each.is_given or each not in terms:
            continue
        operation = OPERATIONS.get(each.operation)
        if operation is None or operation.partials is None:
            raise ValueError(f'{each.operation} has no derivative here')
        bar = total(terms[each])
        for operand, partial in zip(each.operands, operation.partials(each, *each.operands)):
            if isinstance(operand, Symbol):
                terms.setdefault(operand, []).append(bar * partial)
    return [total(terms.get(each, [])) for each in x]


def ancestors(values: Iterable[Any]) -> set[Symbol]:
    """Return all symbols that values are computed from, themselves included."""
    found: set[Symbol] = set()
    left = [value for value in values if isinstance(value, Symbol)]
    while left:
        symbol = left.pop()
        if symbol not in found:
            found.add(symbol)
            left += [each for each in symbol.operands if isinstance(each, Symbol)]
    return found
