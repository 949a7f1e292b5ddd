# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Why a force is what it is: what the mpc reports of a tick, by its keys in /diagnostics."""

from dataclasses import dataclass, fields, MISSING
import math
from typing import Any

from dp_swing_ros.messages.fields import diagnostic, Figures
from dp_swing_ros.pendulum.state import joints


@dataclass(frozen=True, kw_only=True)
class TickReport:
    """
    What a tick of the mpc did, and what it takes to repeat it.

    Each field is a value of the status `mpc` on /diagnostics, by its name; those with a default
    are not in the oldest bags. The items of a mapping are values by keys of their own.
    """

    solver: str = diagnostic('who solved', default='')
    status: str = diagnostic('how the solve ended, or what stands for one: a name of `Status`')
    dynamics: str = diagnostic(
        'which drive: `analytic` or `learned`, see [learned dynamics](learned_dynamics.md)',
        default='')
    cost: float = diagnostic('what the plan costs')
    cost_terms: Figures = diagnostic(
        'its terms, whose sum it is: `position`, `angles`, `velocities`, `force`, `limits` (what '
        'lies beyond the soft limits of track and speed), `terminal`', key='cost_{}',
        default_factory=dict)
    step: float = diagnostic(
        'of the plan; it [goes with the period of the states](theory.md#policy-shift)', 's',
        default=math.nan)
    iterations: int = diagnostic('of the solve that led to the plan', default=0)
    solve_time: float = diagnostic('of the tick, with the estimate and all starts', 's',
                                   default=math.nan)
    phases: Figures = diagnostic(
        'of that: `estimate` (state, and what it is when the force acts), `starts` (making them), '
        'and over all solves `rollout`, `derivatives`, `backward`, `line_search` of iLQR and DDP, '
        '`noise`, `rollouts`, `update` of MPPI', 's', key='{}_time', default_factory=dict)
    start: str = diagnostic('from which start the plan came that is obeyed', default='')
    lead: float = diagnostic(
        'how much cheaper it is than the next best (`inf` where it was alone)', default=math.inf)
    starts: str = diagnostic('all starts of the tick in their order', default='')
    costs: str = diagnostic('what each led to', default='')
    solves: str = diagnostic('in how many iterations')
    age: float = diagnostic('of the state when it came', 's', default=0.0)
    latency: float = diagnostic('from the measurement of the state until the force was sent', 's',
                                default=math.nan)
    delay: float = diagnostic('from the measurement until the force was to act', 's')
    late: bool = diagnostic('whether the tick took longer than the period of the states',
                            default=False)
    late_total: int = diagnostic('how often that was', default=0)
    missed_total: int = diagnostic(
        'states that were overtaken by newer ones or lost: they are not solved', default=0)
    force: float = diagnostic(
        'that was sent; what the drive takes instead, in V, m/s^2 or m/s', 'N')
    real_time: bool = diagnostic('whether nobody waits for anybody')
    time: float | None = diagnostic(
        'when the state was measured, by the clock of the mpc', 's', default=None)
    time_noise: float = diagnostic('by which that may be off', 's', default=0.0)
    carried: int = diagnostic('periods without a state')
    resets: int = diagnostic('since the start')
    revision: int | None = diagnostic('how often the parameters had changed', default=None)
    number: int = diagnostic('of the force')
    again: int = diagnostic(
        'forces before it that were sent again, for a state that a plant in lockstep sent again',
        default=0)
    enabled: bool = diagnostic('whether a force may act', default=True)
    stopping: bool = diagnostic('whether there is a controlled stop', default=False)
    sent: int = diagnostic(
        'when the state was, by its sender: which it was where stamps stand still', 'ns',
        default=0)
    clock: str = diagnostic('what the stamps of the states are', default='')
    estimate: Figures = diagnostic(
        'the state as `estimate_JOINT_position` and `_velocity`, the innovation likewise, '
        '`innovation_distance` in standard deviations, how many states were `refused`, '
        'whether states are `explained` by some pendulum, to within the noises, the angles '
        'at which links stand balanced as `linkN_balance`, and physical parameters and drive by '
        'their names', key='{}', default_factory=dict)

    @classmethod
    def read(cls, values: Figures) -> 'TickReport':
        """
        Return the report that has these values, of which those NEEDED must be there.

        Costs by terms, phases and the estimate stay in the values.
        """
        return cls(**{name: kind(values[name]) for name, kind in KINDS.items() if name in values})

    def values(self) -> dict[str, float | int | str]:
        """Return all values by their keys."""
        found: dict[str, float | int | str] = {}
        for name, key in KEYS.items():
            value = getattr(self, name)
            if key:
                found.update({key.format(one): number for one, number in value.items()})
            else:
                found[name] = value
        return found


KEYS: dict[str, str] = {each.name: each.metadata['key'] for each in fields(TickReport)}
NEEDED = tuple(each.name for each in fields(TickReport)
               if each.default is MISSING and each.default_factory is MISSING)
KINDS: dict[str, Any] = {
    each.name: kind for each in fields(TickReport)
    for kind in (bool, int, str, float) if each.type in (kind, kind | None)}


def keys_of_state(what: str, links: int) -> list[str]:
    """Return the keys of an 'estimate' or 'innovation' in the order of the state."""
    return [f'{what}_{joint}_{kind}' for kind in ('position', 'velocity')
            for joint in joints(links)]
