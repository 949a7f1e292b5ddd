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

The symbols can be differentiated too (`gradient`), so that nobody has to do it by hand. Source:
Griewank and Walther, Evaluating Derivatives, 2008, 3.2 (the reverse mode).
"""

from collections.abc import Callable, Iterable, Sequence
import functools
import hashlib
import inspect
from pathlib import Path
from typing import Any

from numba import typeof, types
from numba.extending import models, NativeValue, overload, register_model, typeof_impl, unbox
import numpy as np

OPTIONS: Any = {'error_model': 'numpy', 'forceinline': True, 'fastmath': {'contract'}}


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
        reciprocal = self.trace.symbol('reciprocal', self)
        return reciprocal if is_constant(other, 1) else other * reciprocal


class Elements:
    """An array whose elements are symbols: read where asked for, written when all is computed."""

    def __init__(self, trace: 'Trace', text: str) -> None:
        """Take what the array is called."""
        self.trace, self.text = trace, text

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


class Trace:
    """What a function did with its symbols, each operation once."""

    def __init__(self) -> None:
        """Begin with nothing done."""
        self.symbols: dict[tuple, Symbol] = {}
        self.written: dict[str, Any] = {}
        self.calls: dict[Symbol, tuple[Callable, tuple]] = {}
        self.texts: dict[int, tuple[str, Any]] = {}   # of structures that are arguments, by id

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

    def argument(self, kind: Any, text: str) -> Any:
        """Return what stands for an argument of a Numba type."""
        if is_tuple(kind):
            named = isinstance(kind, types.BaseNamedTuple)
            parts = [self.argument(each, f'{text}.{kind.fields[i]}' if named else f'{text}[{i}]')
                     for i, each in enumerate(kind.types)]
            structure = kind.instance_class(*parts) if named else tuple(parts)
            self.texts[id(structure)] = text, structure
            return structure
        if isinstance(kind, types.NoneType):
            return None
        if isinstance(kind, types.Array):
            return Elements(self, text)
        if isinstance(kind, ConstantType):
            self.texts[id(kind.value)] = text, kind.value
            return kind.value
        return self.symbol(text)


def called(function: Callable, count: int, *arguments: Any) -> list[Any]:
    """
    Call an unrolled function that returns so many numbers, in a trace by a call.

    What is called is compiled once for all calls, and cannot be differentiated.
    """
    given = [each for each in flat(arguments) if isinstance(each, Symbol)]
    if not given:
        return list(function(*arguments))
    trace = given[0].trace
    call = trace.symbol(f'call {len(trace.calls)}', *given)
    trace.calls[call] = function, arguments
    return [trace.symbol(f'item {i}', call) for i in range(count)]


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


def clamp(x: Any, bound: Any) -> Any:
    """Return x, or the bound on its side where it is beyond, likewise."""
    if isinstance(x, Symbol):
        return x.trace.symbol('clamp', x, bound)
    return x.clamp(-bound, bound) if hasattr(x, 'clamp') else np.clip(x, -bound, bound)


def is_nonzero(x: Any) -> Any:
    """Return 1 where x is not zero and 0 where it is, as a number."""
    return x.trace.symbol('is_nonzero', x) if isinstance(x, Symbol) else 1.0 * (x != 0)


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


def gradient(y: Any, x: Sequence[Any]) -> list[Any]:
    """Return the derivatives of a symbol by others, in the reverse mode."""
    terms: dict[Any, list[Any]] = {y: [1.0]}   # of the adjoint of each symbol
    for each in sorted(ancestors([y]), key=lambda one: one.order, reverse=True):
        if each.operands and each in terms:
            bar = total(terms[each])
            for operand, partial in zip(each.operands, partials(each)):
                if isinstance(operand, Symbol):
                    terms.setdefault(operand, []).append(bar * partial)
    return [total(terms.get(each, [])) for each in x]


def partials(y: Symbol) -> tuple[Any, ...]:
    """Return the derivatives of an operation by its operands."""
    x = y.operands
    match y.operation:
        case '+':
            return 1.0, 1.0
        case '-':
            return 1.0, -1.0
        case '*':
            return x[1], x[0]
        case 'neg':
            return (-1.0,)
        case 'reciprocal':
            return (-(y * y),)
        case 'fixed':
            return (0.0,)
        case 'sin':
            return (cos(x[0]),)
        case 'cos':
            return (-sin(x[0]),)
    if x:
        raise ValueError(f'{y.operation} has no derivative here')
    return ()


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


class Program:
    """The text of a function that computes symbols, writes elements and returns a structure."""

    def __init__(self, trace: Trace, single: bool) -> None:
        """Take whether constants are of single precision; wider ones would widen all else."""
        self.trace, self.single, self.lines = trace, single, list[str]()
        self.names: dict[Any, str] = {}
        self.constants: dict[str, Any] = {}

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
        x = list(map(self.text, symbol.operands))
        match symbol.operation.split()[0]:
            case '+' | '-' | '*' as sign:
                text = f'{x[0]} {sign} {x[1]}'
            case 'item':
                text = f'{x[0]}[{symbol.operation.split()[1]}]'
            case 'neg':
                text = f'-{x[0]}'
            case 'reciprocal':
                text = f'{self.text(1.0)} / {x[0]}'
            case 'fixed':
                self.names[symbol] = x[0]
                return
            case 'clamp':
                text = f'min(max({x[0]}, -{x[1]}), {x[1]})'
            case 'is_nonzero':
                text = f'{self.text(1.0)} if {x[0]} != {self.text(0.0)} else {self.text(0.0)}'
            case 'sin' | 'cos' as which:
                other = cos(symbol.operands[0]) if which == 'sin' else sin(symbol.operands[0])
                self.names[other] = f'{name}o'
                both = (name, f'{name}o') if which == 'sin' else (f'{name}o', name)
                self.lines.append(f'{both[0]}, {both[1]} = sincos({x[0]})')
                return
            case _:
                text = symbol.operation
        self.lines.append(f'{name} = {text}')

    def write(self, places: Iterable[str], value: Any) -> None:
        """Write a computed number to elements of arrays."""
        self.lines += [f'{place} = {self.text(value)}' for place in places]

    def text(self, value: Any) -> str:
        """Return a computed symbol, a constant or a structure of them as text."""
        if isinstance(value, Symbol):
            return self.names[value]
        if isinstance(value, Elements) or value is None:
            return value.text if value else 'None'
        if id(value) in self.trace.texts:
            return self.trace.texts[id(value)][0]
        if isinstance(value, (tuple, list)):
            inner = ''.join(f'{self.text(each)}, ' for each in value)
            if hasattr(value, '_fields'):
                self.constants[type(value).__name__] = type(value)
                return f'{type(value).__name__}({inner})'
            return f'({inner})'
        if isinstance(value, int):
            return str(value)
        number = (np.float32 if self.single else float)(value)
        name = f'c_{repr(float(number)).translate(str.maketrans("-.+", "mdp"))}'
        self.constants[name] = number
        return name


def is_tuple(kind: Any) -> bool:
    """Return whether a Numba type is one of tuples."""
    return isinstance(kind, types.BaseTuple)


def flat(value: Any) -> list[Any]:
    """Return the numbers of a structure in order."""
    return [each for part in value for each in flat(part)] if isinstance(
        value, (tuple, list)) else [value]


def is_single(kind: Any) -> bool:
    """Return whether a Numba type has numbers of single precision."""
    if is_tuple(kind):
        return any(map(is_single, kind.types))
    return getattr(kind, 'dtype', kind) == types.float32


def written_out(function: Callable, kinds: Sequence[Any]) -> Callable:
    """Return the straight-line function that an unrolled one is for arguments of some types."""
    from dp_swing_ros.kernels.trigonometry import sincos

    names, trace = list(inspect.signature(function).parameters), Trace()
    result = function(*(trace.argument(kind, name) for kind, name in zip(kinds, names)))
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
    lines = [*program.lines, f'return {None if result is None else program.text(result)}']
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
    source of its module.
    """

    def __init__(self, name: str, of: Callable) -> None:
        """Take its name, and a function of the module that defines it."""
        source = inspect.getsourcefile(of)
        text = Path(source).read_bytes() if source else of.__code__.co_code
        identity = f'{name}-{hashlib.sha256(text).hexdigest()[:16]}'
        ConstantType.known[identity] = self
        self.numba_type = ConstantType(identity)   # made once: Numba asks for it at every call


register_model(ConstantType)(models.OpaqueModel)


@typeof_impl.register(Constant)
def _type_of(constant: Constant, context: Any) -> ConstantType:
    return constant.numba_type


@unbox(ConstantType)
def _unboxed(kind: ConstantType, value: Any, context: Any) -> NativeValue:
    return NativeValue(context.context.get_dummy_value())


def same_type_by(key: Callable[[Any], Any]) -> Callable[[type], type]:
    """
    Let Numba find the type of a class's instances once for each key, instead of at every call.

    The key must hold all that the type depends on; the type of a tuple of tuples takes Numba
    longer to find than a short kernel takes to run.
    """
    def register(cls: type) -> type:
        found: dict[Any, types.Type] = {}

        @typeof_impl.register(cls)
        def type_of(value: Any, context: Any) -> types.Type:
            known = key(value)
            if known not in found:
                found[known] = typeof_impl.dispatch(tuple)(value, context)
            return found[known]

        def known_type(value: Any) -> types.Type:
            return found.get(key(value)) or typeof(value)

        # where Numba's dispatcher looks before it asks Python
        setattr(cls, '_numba_type_', property(known_type))
        return cls
    return register
