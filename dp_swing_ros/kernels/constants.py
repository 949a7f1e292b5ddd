# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What kernels are compiled for: constants as a part of a type, and types found at once."""

from collections.abc import Callable
import hashlib
import inspect
from pathlib import Path
from typing import Any

from numba import typeof, types
from numba.extending import models, NativeValue, register_model, typeof_impl, unbox


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
