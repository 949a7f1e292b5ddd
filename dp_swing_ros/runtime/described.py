# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pendulum that a robot description on the network is of, in place of given parameters."""

import dataclasses
from typing import Any

from dp_swing_ros.control import controllers
from dp_swing_ros.messages.fields import ERROR, OK, WARN
from dp_swing_ros.parameters import checked, fields_of, ParameterError, Values
from dp_swing_ros.pendulum.description import parameters_of
from dp_swing_ros.pendulum.parameters import DriveParameters, LimitParameters, SPRINGS
from dp_swing_ros.runtime.sent import Said

Fields = dict[str, dataclasses.Field]


class DescribedPendulum:
    """Takes the first robot description that agrees with what was given, and no other."""

    def __init__(self, given: Values) -> None:
        """Take the parameters that the mpc was given, by their full names."""
        self.given = given
        self.fields: Fields = {}           # all of the mpc, with what is described for defaults
        self.values: dict[str, Any] = {}   # what is described
        self.text: str | None = None       # of the newest description

    def hear(self, text: str) -> Said | None:
        """Take a robot description, or refuse it; return what is to be said of that."""
        if text == self.text:
            return None
        self.text = text
        try:
            found = parameters_of(text)
            fields, values = agreed(found.values, self.given)
        except ArithmeticError:
            return self._refused('numbers of it are beyond all bounds')
        except ValueError as error:
            return self._refused(str(error))
        if self.fields:
            changed = [f'{name} is {_shown(values.get(name))} now, it was '
                       f'{_shown(self.values.get(name))}' for name in {**self.values, **values}
                       if values.get(name) != self.values.get(name)]
            return self._refused(', '.join(changed)) if changed else None
        self.fields, self.values = fields, values
        # a centre, an inertia or a friction of 0 is one that is not there
        taken = ', '.join(f'{name} {_shown(value)}' for name, value in values.items() if value)
        unsaid = [name for name in ('gravity', 'drive', *(
            field.name for field in fields_of(DriveParameters, values['links'])),
            *(f'joint{i}_{each}' for each in SPRINGS for i in range(1, values['links'] + 1)))
            if name not in values]
        return Said(OK, '; '.join([
            f'the robot description gives {taken}',
            f'it has no word for {", ".join(unsaid)}, which stay parameters', *found.left_out]))

    def _refused(self, why: str) -> Said:
        if self.fields:
            return Said(WARN, f'refused: {why}; going on with the first robot description, start '
                              'the mpc anew to take another')
        return Said(ERROR, f'refused: {why}; waiting for another robot description')


def agreed(described: Values, given: Values) -> tuple[Fields, dict[str, Any]]:
    """
    Return the parameters of the mpc with what is described for defaults, and that by name.

    A limit that was given may be the smaller one, and prevails. Raises ParameterError for all else
    that was given otherwise.
    """
    fields = controllers.MPC.fields_for({**given, **described})
    limits = {field.name for field in dataclasses.fields(LimitParameters)}
    values, conflicts = dict[str, Any](), []
    for name, value in described.items():
        value = checked(fields[name], value, name)
        told = checked(fields[name], given.get(name, value), name)
        if name in limits and told < value:
            continue
        if told != value:
            conflicts.append(f'{name} is {_shown(value)} in the robot description, and parameter '
                             f'{name} is {_shown(told)}')
        fields[name].default = values[name] = value
    if conflicts:
        raise ParameterError(f'{", ".join(conflicts)}; expected the same: leave the parameter out')
    return fields, values


def _shown(value: Any) -> str:
    return f'{value:g}' if isinstance(value, float) else str(value)
