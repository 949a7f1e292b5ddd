# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How near the solvers come to what this processor can do, and what a whole tick consists of.

operations.py counts what the kernels do. The best of the processor is measured for the same mix of
operations, by chains side by side that stay in registers, written in LLVM's language so that no
compiler has a choice. One chain alone tells how long a result is waited for, and so how long the
longest chain in a kernel takes at least, however much is done beside it.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
import ctypes
from functools import partial
import json
import math
import os
import subprocess
import sys
import threading
import time
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import operations
from operations import Counts
from peers_gradient import first_plan, ITERATIONS, LINKS, OURS, problem
from timing import median, PAUSE, race, Work

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.trigonometry import sincos
from dp_swing_ros.pendulum import derivatives
from dp_swing_ros.pendulum.model import rollout, size
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.runtime.sent import Force
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.descent import PHASES

ROUNDS = 20_000      # of all chains, in a call
ANGLES = 2048        # in the first-level cache
STEPS = 3000         # of a rollout, long beside its call
SAMPLES = 8192
REPEATS = 10         # solves of a round
FIRST = 20           # ticks until the pendulum stands
NOISE = 1e-3         # of its states, in their units
PAUSES = {'at 20 Hz': 0.05, 'at once': 0.0}   # [s] between ticks
PATIENCE = 1.0       # [s]
MIXED = 'fma', 'add', 'multiply'
PARTS = PHASES[1:]   # of an iteration
SHARED = 'derivatives', 'line_search'   # by both
OPERATIONS = {'fma': 'call {v} @llvm.fma.v{n}{s}({v} %x{i}, {v} %m, {v} %c)',
              'add': 'fadd {v} %x{i}, %c', 'multiply': 'fmul {v} %x{i}, %m',
              'divide': 'fdiv {v} %x{i}, %m'}
TYPES = {'double': ('double', 'f64', ctypes.c_double), 'single': ('float', 'f32', ctypes.c_float)}
ITERATION, ROLLOUT, SAMPLE = 'iteration', 'rollout of the model', 'mppi, step of a sample'
KERNELS, ITERATIONS_OF = 'kernels of the solver', 'iterations'   # of a tick


def program(precision: str, lanes: int, kinds: Sequence[str]) -> str:
    """Return spin(first, m, c, n) in LLVM: n times it does to each chain what its kind says."""
    scalar, suffix, _ = TYPES[precision]
    v, each = f'<{lanes} x {scalar}>', range(len(kinds))

    def filled(name: str, value: str) -> str:
        return (f'%{name}_0 = insertelement {v} undef, {scalar} {value}, i32 0\n%{name} = '
                f'shufflevector {v} %{name}_0, {v} undef, <{lanes} x i32> zeroinitializer')
    return '\n'.join([
        f'declare {v} @llvm.fma.v{lanes}{suffix}({v}, {v}, {v})',
        f'define {scalar} @spin({scalar} %first, {scalar} %factor, {scalar} %more, i64 %n) #0 {{',
        'begin:', filled('m', '%factor'), filled('c', '%more'),
        *(f'%k{i} = uitofp i64 {i} to {scalar}\n%f{i} = fadd {scalar} %first, %k{i}\n'
          + filled(f'a{i}', f'%f{i}') for i in each),
        'br label %loop', 'loop:', '%t = phi i64 [0, %begin], [%next, %loop]',
        *(f'%x{i} = phi {v} [%a{i}, %begin], [%y{i}, %loop]' for i in each),
        *(f'%y{i} = ' + OPERATIONS[kind].format(v=v, n=lanes, s=suffix, i=i)
          for i, kind in enumerate(kinds)),
        '%next = add i64 %t, 1', '%done = icmp eq i64 %next, %n',
        'br i1 %done, label %end, label %loop', 'end:', f'%s0 = fadd {v} %y0, %y0',
        *(f'%s{i} = fadd {v} %s{i - 1}, %y{i}' for i in each[1:]),
        f'%result = extractelement {v} %s{len(kinds) - 1}, i32 0', f'ret {scalar} %result', '}',
        'attributes #0 = { "prefer-vector-width"="512" "min-legal-vector-width"="512" }'])


class Spinner:
    """A program, compiled; its work is counted in operations on a number."""

    def __init__(self, precision: str, lanes: int, kinds: Sequence[str]) -> None:
        """Compile."""
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        module = llvm.parse_assembly(program(precision, lanes, kinds))
        target = llvm.Target.from_default_triple().create_target_machine(
            cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=3)
        self.assembly = target.emit_assembly(module)
        self.engine = llvm.create_mcjit_compiler(module, target)   # owns the code
        self.engine.finalize_object()
        number = TYPES[precision][2]
        self.spin = ctypes.CFUNCTYPE(number, number, number, number, ctypes.c_int64)(
            self.engine.get_function_address('spin'))
        self.units = ROUNDS * lanes * len(kinds)

    def run(self) -> int:
        """Do the work, on numbers that stay near the first."""
        self.spin(1.0, 1.0000002, 1e-9, ROUNDS)
        return self.units


def widths(precision: str) -> dict[str, int]:
    """Return how many numbers the widest registers of this processor hold, and one."""
    features, number = llvm.get_host_cpu_features(), TYPES[precision][2]
    widest = 64 if features.get('avx512f') else 32 if features.get('avx2') else 16
    return {'vector': widest // ctypes.sizeof(number), 'scalar': 1}


def mix(counts: Counts) -> list[str]:
    """Return chains, enough for all units and not too many for the registers, of such shares."""
    chains = 24 if llvm.get_host_cpu_features().get('avx512f') else 12
    number = sum(counts.get(kind, 0) for kind in MIXED)
    found = [kind for kind in MIXED for _ in range(round(chains * counts.get(kind, 0) / number))]
    return np.random.default_rng(0).permutation(found).tolist()


@kernel
def sines(x: Array) -> None:
    """Replace angles, which the compiler does side by side."""
    for i in range(len(x)):
        s, c = sincos(x[i])
        x[i] = s + c


@kernel
def sines_in_order(x: Array) -> float:
    """Add up in order, so that it may not."""
    total = x[0]
    for i in range(len(x)):
        s, c = sincos(x[i])
        total += s * c
    return total


@kernel
def sines_in_a_chain(x: float, n: int) -> float:
    """Wait for each before the next."""
    for _ in range(n):
        s, c = sincos(x)
        x = s + c
    return x


def processor_works() -> dict[str, Work]:
    """Return what shows the best of this processor, by precision, width and kind."""
    def of_angles(function: Callable, *arguments: Any) -> Work:
        return lambda: function(*arguments) and ANGLES or ANGLES
    works: dict[str, Work] = {
        f'latency {kind}': Spinner('double', 1, [kind]).run for kind in OPERATIONS}
    works['latency sincos'] = of_angles(sines_in_a_chain, 0.5, ANGLES)
    for precision, dtype in (('double', np.float64), ('single', np.float32)):
        angles = np.linspace(-3, 3, ANGLES, dtype=dtype)
        for width, lanes in widths(precision).items():
            for kind in ('fma', 'divide'):
                works[f'{precision} {width} {kind}'] = Spinner(
                    precision, lanes, [kind] * len(mix({'fma': 1}))).run
            works[f'{precision} {width} sincos'] = of_angles(
                sines if width == 'vector' else sines_in_order, angles)
    return works


def counted(latencies: Counts, *links: str) -> dict[str, dict[str, dict[str, float]]]:
    """Return what `operations.count` does, in a process without a compiler."""
    done = subprocess.run(
        [sys.executable, operations.__file__, json.dumps(latencies), *links], capture_output=True,
        env={**os.environ, 'NUMBA_DISABLE_JIT': '1'}, text=True, check=True)
    found: dict[str, dict[str, dict[str, float]]] = json.loads(done.stdout)
    return found


def solved(rounds: int) -> dict[str, dict[str, Array]]:
    """Return the times [s] of an iteration or an update by phases, (rounds,), as solvers tell."""
    def solve(solver: Any, plan: Plan) -> dict[str, float]:
        return dict(solver.solve(plan.X[0], plan, math.inf).stats.phases)
    solves, descent = {}, {'iterations': ITERATIONS, 'tolerance': 0.0}
    for links in LINKS:
        of = problem(links=links)
        for name, given in ((OURS[0], descent), (OURS[1], descent),
                            ('mppi', {'iterations': 1, 'samples': SAMPLES})):
            solver = SOLVERS[name](of, SOLVERS[name].Parameters(**given))
            solves[f'{name}, {links}'] = partial(solve, solver, first_plan(of))
    taken: dict[str, list[dict[str, float]]] = {name: [] for name in solves}
    for _ in range(rounds):
        for name, one in solves.items():
            time.sleep(PAUSE)
            each = [one() for _ in range(REPEATS)][1:]
            taken[name].append({phase: float(np.median([phases[phase] for phases in each]))
                                for phase in each[0]})
    return {name: columns(of) for name, of in taken.items()}


def columns(rows: Sequence[Mapping[str, float]]) -> dict[str, Array]:
    """Return the values of all rows by their names."""
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def rows(counts: Mapping[str, Mapping[str, Counts]], taken: Mapping[str, Mapping[str, Array]],
         rollouts: Mapping[str, Array]) -> Iterator[tuple[str, str, Counts, Array]]:
    """Yield what is compared: its name, the links, counts and times [s]."""
    for links, of in counts.items():
        for name in OURS:
            times = taken[f'{name}, {links}']
            needed = {phase: of[f'{name} backward' if phase == 'backward' else phase]
                      for phase in PARTS}
            for what, phases in ((ITERATION, PARTS), *((phase, (phase,)) for phase in PARTS)):
                if name != OURS[0] and what in SHARED:
                    continue
                total = Counter[str]()
                for phase in phases:
                    total.update(needed[phase])
                yield (f'{name}, {what}', links, total,
                       np.sum([times[phase] for phase in phases], axis=0) / ITERATIONS)
        yield ROLLOUT, links, of['rollout'], rollouts[links] * problem().horizon
        yield (SAMPLE, links, of['sample'],
               taken[f'mppi, {links}']['rollouts'] / (SAMPLES * problem().horizon))


def flops(counts: Counts) -> float:
    """Return how many additions and multiplications there are."""
    return 2 * counts['fma'] + counts['add'] + counts['multiply']


def rolled(links: int) -> Work:
    """Return a long rollout of the model alone; its units are steps."""
    of, U = problem(links=links), np.zeros(STEPS)
    x_0 = first_plan(of).X[0]
    return lambda: len(rollout(of.model, x_0, U)) - 1


def compared(rounds: int) -> dict[str, Any]:
    """Return the best of the processor, and the least time of what is compared and its own."""
    best = {name: float(times.min()) for name, times in race(processor_works(), rounds).items()}
    counts = counted({kind: best[f'latency {kind}'] for kind in (*OPERATIONS, 'sincos')})
    rollouts = race({str(links): rolled(links) for links in LINKS}, rounds)
    found, mixes = dict[str, dict[str, dict[str, Any]]](), dict[str, Work]()
    for name, links, needed, times in rows(counts, solved(rounds), rollouts):
        found.setdefault(name, {})[links] = {
            **needed, 'flops': flops(needed), 'seconds': median(times)._asdict()}
        for width, number in widths(precision_of(name)).items():
            mixes[f'{name}: {links}: {width}'] = Spinner(
                precision_of(name), number, mix(needed)).run
    for key, times in race(mixes, rounds).items():
        name, links, width = key.split(': ')
        row, of = found[name][links], f'{precision_of(name)} {width}'
        row[width] = max(   # a unit of its own divides meanwhile
            sum(row[kind] for kind in MIXED) * float(times.min())
            + row['sincos'] * best[f'{of} sincos'], row['divide'] * best[f'{of} divide'])
    three = problem(links=3).model
    return {'best': best, 'rows': found, 'lanes': [size(three) + 1, derivatives.lanes(three)],
            'single': flops(counts['2']['second derivatives'])}


def precision_of(name: str) -> str:
    """Return in which precision something is done."""
    return 'single' if name == SAMPLE else 'double'


def running(ticks: int, pause: float) -> dict[str, Array]:
    """
    Return the times [s] of the parts of ticks of an mpc in this process, with pauses [s] between.

    It holds a pendulum near the goal, in lockstep, so that it does on a busy machine, too.
    """
    import rclpy
    from rclpy.node import Node

    from dp_swing_ros.nodes.connections import publish
    from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
    from dp_swing_ros.nodes.mpc import MpcNode
    from dp_swing_ros.nodes.taking import Executor
    from dp_swing_ros.topics import JOINT_STATES

    rclpy.init(args=['limit', '--ros-args', '-p', 'clock:=lockstep'])
    node, driver = MpcNode(), Node('driver')
    core, states, plans = node.core, publish(driver, JOINT_STATES), list[Plan]()
    spent = defaultdict[str, float](float)   # [s] of a tick

    def timed(name: str, function: Callable, *arguments: Any) -> Any:
        began = time.perf_counter()
        result = function(*arguments)
        spent[name] += time.perf_counter() - began
        return result

    def update(function: Callable, *arguments: Any) -> Plan:
        plans.append(timed('update', function, *arguments))
        return plans[-1]

    def take(on_states: Callable, arrived: Any) -> None:
        came = list(arrived)
        spent['taken'] = time.time() - came[-1].received * 1e-9
        timed('core', on_states, came)

    def send(sent: Any) -> None:
        timed('force' if isinstance(sent, Force) else 'report', node.send, sent)
    with (executor := Executor()):
        node.prepare()
        executor.add_node(node)
        nominal, random, taken = core.controller.nominal, np.random.default_rng(0), list[Counts]()
        x, n = first_plan(nominal).X[0], 0
        setattr(core.controller, 'update', partial(update, core.controller.update))
        setattr(core, 'on_states', partial(take, core.on_states))
        core.send = send
        while not states.get_subscription_count():
            executor.spin_once(PAUSE)
        while len(taken) < FIRST + ticks:
            n += 1
            message = to_joint_state(to_stamp(n * nominal.dt),
                                     x + random.normal(0, NOISE, len(x)), 0.0)
            spent.clear()
            while 'update' not in spent:   # a first message may find nobody yet
                threading.Timer(pause, states.publish, [message]).start()
                end = time.monotonic() + PATIENCE
                while 'update' not in spent and time.monotonic() < end:
                    executor.spin_once(PATIENCE)
            x = rollout(nominal.model, x, plans[-1].U[:1])[1]
            taken.append(of_tick(spent, plans[-1]))
    node.destroy_node()
    driver.destroy_node()
    rclpy.try_shutdown()
    return columns(taken[FIRST:])


def of_tick(spent: Counts, plan: Plan) -> dict[str, float]:
    """Return the parts of a tick, which add up to the whole, and the iterations of its solves."""
    phases = plan.stats.phases
    kernels, estimate = sum(phases[phase] for phase in PHASES), phases['estimate']
    found = {
        KERNELS: kernels, 'control: estimate of state and pendulum': estimate,
        'control: starts, warm start, limits': spent['update'] - kernels - estimate,
        'node: times, checks, figures': spent['core'] - sum(
            spent[name] for name in ('update', 'force', 'report')),
        'rclpy: from reception to the node': spent['taken'],
        'rclpy: force published': spent['force'],
        'rclpy and messages: plan and report published': spent['report']}
    return {**found, ITERATIONS_OF: plan.stats.iterations}


def measure(rounds: int) -> dict[str, Any]:
    """Return all of it, as numbers for the page."""
    return {**compared(rounds), 'tick': {
        how: {name: median(times)._asdict() for name, times in running(8 * rounds, pause).items()}
        for how, pause in PAUSES.items()}}
