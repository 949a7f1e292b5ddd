# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Parameters: each declared once, with default, unit, range and description.

The ROS parameters, their descriptors and the table in docs/parameters.md come from these classes.
"""

import dataclasses
import difflib
import math
import numbers
from typing import Any, Callable, Iterable

from dp_swing_ros.state import HANGING, SIZE, UPRIGHT

INFINITE = math.inf
LARGEST = 2 ** 63 - 1  # whole number that a ROS parameter holds
SHOWN = 200  # [characters] of a value in an error
WORDS = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a text'}


def parameter(default: Any, description: str, *, unit: str = '', minimum: float | None = None,
              maximum: float | None = None, choices: Callable[[], list[str]] | None = None,
              size: int | None = None, finite: bool = True) -> Any:
    """
    Declare one parameter as a dataclass field.

    minimum and maximum are inclusive and hold for every element of a list; `choices` is called
    when needed, so that a registry may be filled after the class is made; `size` is the length
    of a list; `finite=False` allows infinity (NaN never passes).
    """
    return dataclasses.field(default=default, metadata={
        'description': description, 'unit': unit, 'minimum': minimum, 'maximum': maximum,
        'choices': choices, 'size': size, 'finite': finite})


class ParameterError(ValueError):
    """A parameter has an impossible value; the message says which, and what is expected."""


@dataclasses.dataclass(frozen=True)
class Parameters:
    """A group of parameters, checked when it is made."""

    def __post_init__(self) -> None:
        """
        Check every value against its declaration.

        Raises ParameterError.
        """
        for field in dataclasses.fields(self):
            object.__setattr__(self, field.name, checked(field, getattr(self, field.name)))


def checked(field: dataclasses.Field, value: Any, name: str = '') -> Any:
    """
    Return the value in its declared type; `name` is its full name, if not the field's.

    Raises ParameterError, naming the value, what is expected and the choices.
    """
    default: Any = field.default
    kind, about = type(default), field.metadata

    def refuse(expected: str) -> ParameterError:
        return ParameterError(f'parameter {name or field.name!r} is {_shown(value)}; '
                              f'expected {expected} ({about["description"]})')

    if kind is tuple:
        value = _sequence(value, type(default[0]), about['size'], refuse)
    else:
        value = _converted(value, kind, refuse)
    for element in value if kind is tuple else (value,):
        if isinstance(element, (float, int)):
            _check_number(element, about, refuse)
    if about['choices'] is not None and value not in about['choices']():
        raise refuse(f'one of {", ".join(about["choices"]())}')
    return value


def _shown(value: Any) -> str:
    try:
        return repr(value)[:SHOWN]
    except ValueError:  # Python writes whole numbers of 4,300 digits at most
        return 'beyond all bounds'


def _converted(value: Any, kind: type, refuse: Callable[[str], ParameterError]) -> Any:
    if isinstance(value, int) and abs(value) > LARGEST:
        raise refuse('a whole number of 63 bits at most')
    # A whole number will do for a number; true and false are neither.
    if kind is float and isinstance(value, numbers.Real) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise refuse(WORDS[kind])
    return value


def _sequence(value: Any, kind: type, size: int | None,
              refuse: Callable[[str], ParameterError]) -> tuple[Any, ...]:
    expected = f'a list, each {WORDS[kind]}' if size is None else f'a list of {size} numbers'
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise refuse(expected)
    elements = tuple(_converted(element, kind, lambda _: refuse(expected)) for element in value)
    if size is not None and len(elements) != size:
        raise refuse(expected)
    return elements


def _check_number(number: float, about: Any, refuse: Callable[[str], ParameterError]) -> None:
    minimum, maximum = about['minimum'], about['maximum']
    unit = f' {about["unit"]}' if about['unit'] else ''
    if math.isnan(number) or (about['finite'] and math.isinf(number)):
        raise refuse('a finite number')
    if minimum is not None and number < minimum:
        raise refuse(f'at least {minimum:g}{unit}')
    if maximum is not None and number > maximum:
        raise refuse(f'at most {maximum:g}{unit}')


def unknown(name: str, node: str, known: Iterable[str]) -> ParameterError:
    """Return the error for a parameter that a node does not have, with the closest it has."""
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1)
    hint = f'did you mean {close[0]!r}? ' if close else ''
    return ParameterError(f'unknown parameter {name!r} of the node {node!r}; '
                          f'{hint}available: {", ".join(names)}')


@dataclasses.dataclass(frozen=True)
class PendulumParameters(Parameters):
    """The bodies: a cart and two links. Source: the paper, II-A, and its authors' runs."""

    cart_mass: float = parameter(1.0, 'mass of the cart, m0', unit='kg', minimum=1e-3)
    link1_mass: float = parameter(0.5, 'mass of link 1, m1', unit='kg', minimum=1e-3)
    link2_mass: float = parameter(0.5, 'mass of link 2, m2', unit='kg', minimum=1e-3)
    link1_length: float = parameter(1.0, 'length of link 1, l1', unit='m', minimum=1e-3)
    link2_length: float = parameter(1.0, 'length of link 2, l2', unit='m', minimum=1e-3)
    link1_inertia_factor: float = parameter(
        1.0, 'moment of inertia of link 1 about its centre, in those of a uniform rod, m1 l1^2/12',
        minimum=1e-3)
    link2_inertia_factor: float = parameter(
        1.0, 'moment of inertia of link 2 about its centre, in those of a uniform rod, m2 l2^2/12',
        minimum=1e-3)
    gravity: float = parameter(9.81, 'acceleration of gravity, g', unit='m/s^2', minimum=0.0)
    cart_friction: float = parameter(
        0.0, 'viscous friction of the cart on the track', unit='N s/m', minimum=0.0)
    joint1_friction: float = parameter(
        0.0, 'viscous friction between cart and link 1', unit='N m s/rad', minimum=0.0)
    joint2_friction: float = parameter(
        0.0, 'viscous friction between link 1 and link 2', unit='N m s/rad', minimum=0.0)


@dataclasses.dataclass(frozen=True)
class LimitParameters(Parameters):
    """What the actuator and the track allow; plant and controller should be told the same."""

    force_limit: float = parameter(
        20.0, 'largest force on the cart, either way', unit='N', minimum=0.0, finite=False)
    track_limit: float = parameter(
        2.4, 'the cart stays within this distance of the centre', unit='m', minimum=1e-3,
        finite=False)


def _models() -> list[str]:
    # looked up when a value is checked: the models are built of these parameters
    from dp_swing_ros.dynamics import MODELS

    return list(MODELS)


@dataclasses.dataclass(frozen=True)
class PlantParameters(Parameters):
    """The plant beside its bodies and limits: schedule, start, integrator and disturbances."""

    rate: float = parameter(20.0, 'states published per second', unit='Hz', minimum=1.0,
                            maximum=1000.0)
    initial_state: tuple[float, ...] = parameter(
        HANGING, 'state at the start and after a reset [x, θ1, θ2, ẋ, θ̇1, θ̇2]',
        unit='m, rad, m/s, rad/s', size=SIZE)
    physics_step: float = parameter(0.005, 'longest step of the integrator', unit='s',
                                    minimum=1e-5, maximum=1.0)
    integrator: str = parameter('rk4', 'integrator of the plant', choices=_models)
    lockstep: bool = parameter(
        False, 'wait for one force after each state instead of running in real time')
    duration: float = parameter(0.0, 'the plant ends itself after this time (0: never)', unit='s',
                                minimum=0.0)
    command_timeout: float = parameter(
        0.2, 'without a command for this long the force is zero (real time only)', unit='s',
        minimum=1e-3)
    position_noise: float = parameter(
        0.0, 'standard deviation of the measured positions', unit='m, rad', minimum=0.0)
    velocity_noise: float = parameter(
        0.0, 'standard deviation of the measured velocities', unit='m/s, rad/s', minimum=0.0)
    force_noise: float = parameter(
        0.0, 'standard deviation of the applied force, drawn once a period', unit='N',
        minimum=0.0)
    actuator_response: float = parameter(
        1.0, 'share k of the way to the commanded force that the actuator goes in a physics step; '
        'above 1 it overshoots', minimum=1e-3, maximum=2.0)
    delay: float = parameter(0.0, 'age of a measurement when it is published', unit='s',
                             minimum=0.0, maximum=1.0)
    command_jitter: float = parameter(
        0.0, 'a command acts late by a time drawn from 0 to this', unit='s', minimum=0.0,
        maximum=1.0)
    command_loss: float = parameter(
        0.0, 'probability that a command is lost', minimum=0.0, maximum=1.0)
    state_loss: float = parameter(
        0.0, 'probability that a state is lost', minimum=0.0, maximum=1.0)
    disturbance_limit: float = parameter(
        100.0, 'a disturbance is refused where those of a period would exceed this', unit='N',
        minimum=0.0)
    seed: int = parameter(0, 'seed of all noises, losses and latenesses', minimum=0)


@dataclasses.dataclass(frozen=True)
class CostParameters(Parameters):
    """The cost. Source: the paper, II-B; the tuned defaults are explained in docs/model.md."""

    reference: tuple[float, ...] = parameter(
        UPRIGHT, 'reference state x_r; an equilibrium, so angles are 0 or π and speeds 0',
        unit='m, rad, m/s, rad/s', size=SIZE)
    state_weights: tuple[float, ...] = parameter(
        (10.0, 100.0, 100.0, 2.0, 6.0, 0.1), 'diagonal of S, the weights of the state error',
        minimum=0.0, size=SIZE)
    force_weight: float = parameter(0.001, 'R, the weight of the force', unit='1/N^2',
                                    minimum=1e-9)
    angle_error: str = parameter(
        'chord', 'error of an angle: chord = 2 sin(θ/2), periodic; angle = θ, as in the paper',
        choices=lambda: ['chord', 'angle'])
    terminal_cost: str = parameter(
        'lqr', 'lqr = the infinite-horizon LQR value; scaled = terminal_scale S, as in the paper',
        choices=lambda: ['lqr', 'scaled'])
    terminal_scale: float = parameter(
        1000.0, 'factor of S in the scaled terminal cost', minimum=0.0)
    track_weight: float = parameter(
        3000.0, 'weight of the squared distance into the margin of the track', unit='1/m^2',
        minimum=0.0)
    track_margin: float = parameter(
        0.4, 'width of the soft margin inside the track limit', unit='m', minimum=0.0)


@dataclasses.dataclass(frozen=True)
class PredictionParameters(Parameters):
    """How the controller looks ahead."""

    horizon: int = parameter(30, 'number of steps of a plan, N', minimum=1, maximum=1000)
    step: float = parameter(0.05, 'duration of one step of a plan', unit='s', minimum=1e-4,
                            maximum=1.0)
    model: str = parameter('rk4', 'how one step is predicted', choices=_models)
