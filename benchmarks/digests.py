# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Digests of lockstep runs: states, forces and plans to the bit, before and after a change of code.

    python benchmarks/digests.py --out before.json
    python benchmarks/digests.py --against before.json

Without ROS: solvers, links, set-ups, faults, learned dynamics. With real nodes, stepped one period
at a time: live changes of parameters, resets, pauses, what is disabled and enabled again. It knows
the package by what users do alone, so that it can be run on any two states of the sources, on one
machine.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
import contextlib
import hashlib
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np

from dp_swing_ros import controller, plant, simulate

DURATION = 4.0   # [s] of a run without ROS
PATIENCE = 120.0   # [s] for what nodes do
SOLVERS = ('ilqr', 'ddp', 'mppi')
CONFIG = Path(__file__).parents[1] / 'config'

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
    'rates': ({'rate': 100.0}, {'step': 0.05, 'solve_rate': 25.0}),
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


def run(setup: Setup, solver: str, links: int, extra: Mapping[str, Any] = {}) -> str:
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


class Nodes:
    """A plant in lockstep and an mpc, stepped from outside, and all that they publish."""

    def __init__(self, folder: Path, values: Setup) -> None:
        """Start both, and pause the plant before its tenth state."""
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import QoSProfile
        from sensor_msgs.msg import JointState
        from std_msgs.msg import Float64
        from trajectory_msgs.msg import JointTrajectory

        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node('digests', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard: dict[str, list[Any]] = {'states': [], 'forces': [], 'plans': []}
        qos = QoSProfile(depth=5000)
        for name, kind, topic in (('states', JointState, 'joint_states'),
                                  ('forces', Float64, 'force_command'),
                                  ('plans', JointTrajectory, 'mpc/plan')):
            self.node.create_subscription(kind, topic, self.heard[name].append, qos)
        self.processes = [
            start(folder, name, parameters) for name, parameters in
            (('mpc', values[1]), ('plant', {**values[0], 'lockstep': True, 'pace': 0.5}))]
        self.until(lambda: self.heard['states'], 'a first state')
        self.switch('/plant/pause', True)
        self.settle()

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Hear until a condition holds."""
        end = time.monotonic() + PATIENCE
        while not condition():
            self.executor.spin_once(timeout_sec=0.05)
            if time.monotonic() > end or any(each.poll() for each in self.processes):
                raise SystemExit(f'digests: no {what}')

    def settle(self) -> None:
        """Wait until each state has its answer."""
        self.until(lambda: len(self.heard['plans']) >= len(self.heard['states']), 'answer')

    def call(self, kind: Any, name: str, **request: Any) -> Any:
        """Call a service."""
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready, name)
        future = client.call_async(kind.Request(**request))
        self.until(future.done, f'answer of {name}')
        self.node.destroy_client(client)
        return future.result()

    def switch(self, name: str, on: bool) -> None:
        """Call a service that switches something."""
        from std_srvs.srv import SetBool
        assert self.call(SetBool, name, data=on).success

    def trigger(self, name: str) -> None:
        """Call a service that does something."""
        from std_srvs.srv import Trigger
        assert self.call(Trigger, name).success

    def put(self, node: str, **values: Any) -> None:
        """Change parameters."""
        from rcl_interfaces.srv import SetParametersAtomically
        from rclpy.parameter import Parameter
        answer = self.call(SetParametersAtomically, f'/{node}/set_parameters_atomically',
                           parameters=[Parameter(name.replace('__', '.'),
                                                 value=value).to_parameter_msg()
                                       for name, value in values.items()])
        assert answer.result.successful, answer.result.reason

    def steps_to(self, number: int) -> None:
        """Step until so many states were published."""
        count = len(self.heard['states'])
        if count > number:
            raise SystemExit(f'digests: the plant was not paused before state {number}')
        while len(self.heard['states']) < number:
            count = len(self.heard['states'])
            self.trigger('/plant/step')
            self.until(lambda: len(self.heard['states']) > count, 'next state')
            self.settle()

    def digest(self) -> str:
        """Return the digest of all that was published."""
        numbers: list[Any] = [[message.data for message in self.heard['forces']]]
        for message in self.heard['states']:
            numbers += [message.header.stamp.sec, message.header.stamp.nanosec, message.position,
                        message.velocity, message.effort]
        for message in self.heard['plans']:
            for point in message.points:
                numbers += [point.positions, point.velocities, point.effort]
        return digest(*numbers)

    def close(self) -> None:
        """End both."""
        for process in self.processes:
            process.send_signal(signal.SIGINT)
        for process in self.processes:
            process.wait(30)
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.shutdown()


def start(folder: Path, name: str, values: Mapping[str, Any]) -> subprocess.Popen[bytes]:
    """Start a node."""
    arguments = [word for key, value in values.items()
                 for word in ('-p', f'{key}:={json.dumps(value)}')]
    with (folder / f'{name}.log').open('wb') as log:
        return subprocess.Popen([sys.executable, '-m', 'dp_swing_ros', name, '--ros-args',
                                 *arguments], stdout=log, stderr=log)


def changed(nodes: Nodes) -> None:
    """Change parameters of both, also the solver, with the pendulum in motion."""
    nodes.steps_to(15)
    nodes.put('mpc', force_weight=0.02, horizon=25)
    nodes.steps_to(25)
    nodes.put('mpc', solver='mppi', mppi__samples=300)
    nodes.put('plant', link2_mass=0.35)
    nodes.steps_to(40)
    nodes.put('mpc', solver='ddp', estimator='none')
    nodes.steps_to(55)


def reset(nodes: Nodes) -> None:
    """Reset the controller, then the plant."""
    nodes.steps_to(15)
    nodes.trigger('/mpc/reset')
    nodes.steps_to(30)
    nodes.trigger('/plant/reset')
    nodes.until(lambda: len(nodes.heard['states']) > 30, 'state of the reset')
    nodes.settle()
    nodes.steps_to(45)


def disabled(nodes: Nodes) -> None:
    """Disable the controller, and enable it again."""
    nodes.steps_to(15)
    nodes.switch('/mpc/enable', False)
    nodes.steps_to(25)
    nodes.switch('/mpc/enable', True)
    nodes.steps_to(45)


LIVE = {'live changes': changed, 'resets': reset, 'disabled': disabled}


def live(do: Callable[[Nodes], None], solver: str) -> str:
    """Return the digest of a run of real nodes."""
    with tempfile.TemporaryDirectory() as folder:
        nodes = Nodes(Path(folder), ({'seed': 3}, {'seed': 3, 'solver': solver}))
        try:
            do(nodes)
            return nodes.digest()
        finally:
            nodes.close()


def runs(model: Path | None) -> Iterator[tuple[str, Callable[[], str]]]:
    """Yield the name of each run, and how it is done."""
    for solver in SOLVERS:
        for name, setup in SETUPS.items():
            yield f'{solver}, 2 links, {name}', lambda: run(setup, solver, 2)
        for links in (1, 3):
            for name in LINKED:
                yield f'{solver}, {links} links, {name}', lambda: run(
                    SETUPS[name], solver, links)
        if model is not None:
            yield f'{solver}, learned dynamics', lambda: run(
                SETUPS['default'], solver, 2, {'dynamics': 'learned', 'model': str(model)})
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
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    found: dict[str, str] = {}
    for name, do in runs(arguments.model):
        if arguments.only in name:
            with contextlib.redirect_stdout(sys.stderr):
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
