# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Digests of lockstep runs: states, forces and plans to the bit, before and after a change of code.

    python benchmarks/digests.py --out before.json
    python benchmarks/digests.py --against before.json

Without ROS: solvers, links, set-ups, faults, learned dynamics. With real nodes, stepped one period
at a time: live changes of parameters, resets, pauses, what is disabled and enabled again. Only on
one machine are those of two states of the sources to be compared.
"""

import argparse
from array import array
from collections.abc import Callable, Iterator
import contextlib
import hashlib
import json
from pathlib import Path
import sys
import tempfile
from typing import Any

from campaigns import METHODS
from live_operator import Operator
import numpy as np
from std_srvs.srv import SetBool, Trigger

from dp_swing_ros import controller, plant, simulate
from dp_swing_ros.nodes.connections import QUEUE, subscribe
from dp_swing_ros.tools.processes import Crew, isolated
from dp_swing_ros.topics import FORCE_COMMAND, JOINT_STATES, PLAN

DURATION = 4.0   # [s] of a run without ROS

Values = dict[str, Any]
Setup = tuple[Values, Values]   # parameters of plant and mpc

SETUPS: dict[str, Setup] = {
    'default': ({}, {}),
    'balance': ({'start': 'up_up'}, {}),
    'worse plant': ({'link1_mass': 0.6, 'link2_length': 0.55, 'cart_friction': 0.5,
                     'position_noise': 2e-3, 'velocity_noise': 0.05, 'force_noise': 1.0}, {}),
    'drive': ({'actuation_delay': 0.02, 'motor_time_constant': 0.02, 'force_gain': 0.9,
               'force_bias': 1.0, 'cart_dry_friction': 1.0, 'joint1_dry_friction': 0.02}, {}),
    'told drive': ({'actuation_delay': 0.02, 'motor_time_constant': 0.02},
                   {'actuation_delay': 0.02, 'motor_time_constant': 0.02}),
    'encoders': ({'encoder_counts': 4096, 'velocities': 'differenced'}, {}),
    'no velocities': ({'encoder_counts': 4096, 'velocities': 'none'}, {}),
    'late and lost': ({'delay': 0.05, 'command_jitter': 0.03, 'command_loss': 0.1,
                       'state_loss': 0.1}, {}),
    'no estimator': ({}, {'estimator': 'none'}),
    'as in the paper': ({'physics_step': 0.05, 'integrator': 'euler'},
                        {'estimator': 'none', 'warm_start': 'forces', 'first_starts': 1,
                         'other_starts': 0, 'angle_error': 'angle', 'model': 'euler'}),
    'rates': ({'rate': 100.0}, {'step': 0.05}),
    'limits': ({}, {'force_rate_limit': 200.0, 'controlled_stop': 0.5, 'cart_speed_limit': 3.0}),
    'other goal': ({'start': 'up_up'}, {'goal': 'down_up'})}
LINKED = ('default', 'worse plant', 'drive', 'late and lost')   # with one and three links, too


def digest(*arrays: Any) -> str:
    """Return a digest of numbers, to the bit."""
    found = hashlib.sha256()
    for each in arrays:
        found.update(np.ascontiguousarray(each, dtype=float).tobytes())
    return found.hexdigest()[:16]


def known(node: str, values: Values, links: int) -> Values:
    """Return parameters for so many links."""
    return {'links': links, 'seed': 3, **{
        name: value for name, value in values.items() if links > 1 or 'link2' not in name}}


def run(setup: Setup, solver: str, links: int, **extra: Any) -> str:
    """Return the digest of a run without ROS."""
    system = plant(known('plant', setup[0], links))
    control = controller({**known('mpc', setup[1], links), 'solver': solver, **extra})
    count = round(DURATION * system.parameters.rate)
    pushes = np.zeros(count)
    pushes[count // 2] = 5.0
    parts: list[Any] = []
    episode = simulate(
        system, control, DURATION, solver, pushes=pushes,
        on_tick=lambda t, plan: parts.extend((plan.X, plan.U, plan.stats.cost)))
    return digest(episode.t, episode.X, episode.U, *parts)


class Stepped(Operator):
    """The operator of a plant in lockstep and an mpc, stepped from outside; hears all they say."""

    def __enter__(self) -> 'Stepped':
        super().__enter__()
        self.heard: dict[str, list[Any]] = {FORCE_COMMAND: [], JOINT_STATES: [], PLAN: []}
        for topic, messages in self.heard.items():
            subscribe(self.node, topic, messages.append, depth=QUEUE)
        return self

    def await_answers(self, states: int) -> None:
        """Wait until so many states are there, and each has its plan."""
        if not self.until(lambda: len(self.heard[PLAN]) >= len(self.heard[JOINT_STATES])
                          >= states):
            raise TimeoutError(f'there is no answer to state {states}')

    def do(self, name: str) -> None:
        """Call a service that does something."""
        assert self.call(Trigger, name).success

    def switch(self, name: str, on: bool) -> None:
        """Call a service that switches something."""
        assert self.call(SetBool, name, data=on).success

    def change(self, node: str, **values: Any) -> None:
        """Change parameters of a node."""
        refusal = self.put(node, **values)
        assert not refusal, refusal

    def steps_to(self, number: int) -> None:
        """Step until so many states are there; raises TimeoutError where there are more."""
        if (count := len(self.heard[JOINT_STATES])) > number:
            raise TimeoutError(f'the plant was paused at state {count}, after {number}')
        for state in range(count, number):
            self.do('plant/step')
            self.await_answers(state + 1)

    def digest(self) -> str:
        """Return the digest of all that was published."""
        return digest(*(number for messages in self.heard.values() for message in messages
                        for number in numbers_of(message)))


def numbers_of(message: Any) -> Iterator[Any]:
    """Yield all numbers of a message, in the order of its fields."""
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        if isinstance(value, (int, float, array)):
            yield value
        elif isinstance(value, list):
            for each in value:
                if not isinstance(each, str):
                    yield from numbers_of(each)
        elif not isinstance(value, str):
            yield from numbers_of(value)


def changed(operator: Stepped) -> None:
    """Change parameters of both, also the solver, with the pendulum in motion."""
    operator.steps_to(15)
    operator.change('mpc', force_weight=0.02, horizon=25)
    operator.steps_to(25)
    operator.change('mpc', solver='mppi', mppi__samples=300)
    operator.change('plant', link2_mass=0.35)
    operator.steps_to(40)
    operator.change('mpc', solver='ddp', estimator='none')
    operator.steps_to(55)


def reset(operator: Stepped) -> None:
    """Reset the controller, then the plant."""
    operator.steps_to(15)
    operator.do('mpc/reset')
    operator.steps_to(30)
    operator.do('plant/reset')
    operator.await_answers(31)
    operator.steps_to(45)


def disabled(operator: Stepped) -> None:
    """Disable the controller, and enable it again."""
    operator.steps_to(15)
    operator.switch('mpc/enable', False)
    operator.steps_to(25)
    operator.switch('mpc/enable', True)
    operator.steps_to(45)


LIVE = {'live changes': changed, 'resets': reset, 'disabled': disabled}


def live(do: Callable[[Stepped], None], solver: str) -> str:
    """Return the digest of a run of real nodes, that of the plant paused soon after its start."""
    with tempfile.TemporaryDirectory() as name, Crew() as crew, Stepped() as operator:
        folder = Path(name)
        crew.start('mpc', {'seed': 3, 'solver': solver}, folder / 'mpc.log')
        operator.meet('mpc')
        crew.start('plant', {'seed': 3, 'lockstep': True, 'pace': 0.5}, folder / 'plant.log')
        operator.await_answers(1)
        operator.switch('plant/pause', True)
        operator.await_answers(1)
        do(operator)
        return operator.digest()


def runs(model: Path | None) -> Iterator[tuple[str, Callable[[], str]]]:
    """Yield the name of each run, and how it is done."""
    for solver in METHODS:
        for name, setup in SETUPS.items():
            yield f'{solver}, 2 links, {name}', lambda: run(setup, solver, 2)
        for links in (1, 3):
            for name in LINKED:
                yield f'{solver}, {links} links, {name}', lambda: run(
                    SETUPS[name], solver, links)
        if model is not None:
            yield f'{solver}, learned dynamics', lambda: run(
                SETUPS['default'], solver, 2, dynamics='learned', model=str(model))
        for name, do in LIVE.items():
            yield f'{solver}, nodes, {name}', lambda: live(do, solver)


def main() -> None:
    """Print the digests, and which differ."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--out', type=Path, help='file for the digests')
    parser.add_argument('--against', type=Path, help='such a file, to compare with')
    parser.add_argument('--model', type=Path, help='a file of `learn`, for runs with it')
    parser.add_argument('--only', default='', help='runs whose names contain this')
    arguments = parser.parse_args()
    before = json.loads(arguments.against.read_text()) if arguments.against else {}
    found: dict[str, str] = {}
    for name, do in runs(arguments.model):
        if arguments.only in name:
            with isolated(), contextlib.redirect_stdout(sys.stderr):
                found[name] = do()
            verdict = '' if not before else ' same' if before.get(name) == found[name] else \
                f' WAS {before.get(name)}'
            print(f'{found[name]}  {name}{verdict}', flush=True)
    if arguments.out:
        arguments.out.write_text(json.dumps(found, indent=1) + '\n', encoding='utf-8')
    different = [name for name in found if before and before.get(name) != found[name]]
    print(f'{len(found)} runs' + (f', {len(different)} differ' if before else ''))
    raise SystemExit(bool(different))


if __name__ == '__main__':
    main()
