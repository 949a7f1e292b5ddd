# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The receding horizon: shift, delay, turns of the angles, fallbacks, resets."""

from dataclasses import replace
import math
import os
from pathlib import Path
import subprocess
import sys
import time

from controllers import controller, LIMITS, plant
from learned_dynamics import model_of, of_chain
import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.control.commands import SentCommands
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.pendulum.drive import lagged
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import hold, Model
from dp_swing_ros.pendulum.parameters import DIRECT, Drive, DriveParameters, PendulumParameters
from dp_swing_ros.pendulum.state import angles, hanging, is_upright, to_turn_of, turned, wrapped
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import turns_of
from dp_swing_ros.rerun.answers import repeated
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.simulation.plant import Plant, PlantParameters
from dp_swing_ros.solvers import SOLVERS

FALLING = np.array([0.1, 0.1, -0.05, 0.0, 0.3, 0.0])
LEANING = np.array([0.1, 0.02, -0.01, 0.0, 0.05, 0.0])
TOLD = DriveParameters(actuation_delay=0.03, motor_time_constant=0.025, force_gain=0.8,
                       force_bias=2.0)
BEYOND = np.array([0.0, 0.0, 0.0, 0.0, 1e200, 0.0])   # finite, but no rollout from here is


def fine(c):
    """Return the model by which a controller predicts what the forces sent do."""
    return c.belief.problem.model._replace(h=0.01)


def test_a_converged_plan_needs_one_iteration_in_the_next_tick():
    c = controller()
    plan = c.update(0.0, LEANING)
    assert plan.stats.status is Status.CONVERGED
    assert c.update(0.05, plan.X[1]).stats.iterations <= 2


def test_the_plan_begins_where_the_state_will_be_when_the_force_acts():
    c = controller(estimator='none')
    first = c.update(0.0, FALLING, delay=0.01)
    # no force was sent before
    np.testing.assert_array_equal(first.X[0], hold(c.belief.problem.model, FALLING, 0.0, 0.01))
    second = c.update(0.05, first.X[1], delay=0.02)
    expected = hold(fine(c), first.X[1], first.U[0], 0.02)
    np.testing.assert_allclose(second.X[0], expected, rtol=1e-12)


def test_a_delay_over_several_ticks_replays_every_force_sent():
    c = controller()
    forces = [c.update(0.05 * n, FALLING, delay=0.12).first_force(20.0) for n in range(4)]
    x = FALLING
    # measured at 0.15 s; forces began to act at 0.12, 0.17 and 0.22 s; the next will at 0.27 s
    for u, duration in zip(forces[:3], (0.02, 0.05, 0.05)):
        x = hold(fine(c), x, u, duration)
    found, _ = c.commands.predict(c.nominal.model, DIRECT, FALLING, 0.15, 0.27)
    np.testing.assert_allclose(found, x, rtol=1e-12)


@pytest.mark.parametrize('drive', [DIRECT, Drive(delay=0.03), Drive(time_constant=0.02),
                                   Drive(gain=0.8, bias=-2.0), Drive(0.03, 0.02, 1.2, 1.5)])
def test_the_plan_begins_when_a_command_has_its_effect(drive):
    """Its delay has passed then, and its time constant once more, as if the force stood still."""
    c = controller(estimator='none', drive=drive)
    command = c.update(0.0, FALLING, delay=0.01).first_force(20.0)
    x = FALLING + (0, 0, 0.01, 0, 0, 0)
    plan = c.update(0.05, x, delay=0.01)
    # commands: zero until 0.01 s, then the first; the second acts from 0.06 s on
    f, now, state = 0.0, 0.05, x
    acts = 0.01 + drive.delay
    if acts < now:
        f = lagged(f, command, drive.time_constant, now - acts)[0]
    for until, u in ((max(acts, now), 0.0), (0.06 + drive.delay, command)):
        steps = math.ceil((until - now) / 0.01 - 1e-9)
        for _ in range(steps):
            h = (until - now) / steps
            f, mean = lagged(f, u, drive.time_constant, h)
            state = hold(fine(c), state, drive.gain * mean + drive.bias, h)
        now = until
    state = hold(fine(c), state, drive.gain * f + drive.bias, drive.time_constant)
    np.testing.assert_allclose(plan.X[0], state, atol=1e-12)
    assert plan.drive == drive
    sent = (plan.U[0] - drive.bias) / drive.gain
    assert c.commands.last(math.inf)[0] == pytest.approx(np.clip(sent, -20.0, 20.0), rel=1e-12)


def test_a_plan_stays_within_what_the_drive_can_do():
    c = controller(estimator='none', drive=Drive(gain=0.5, bias=3.0))
    assert c.belief.problem.bounds == pytest.approx((3.0 - 10.0, 3.0 + 10.0))
    plan = c.update(0.0, hanging())
    assert -7.0 <= plan.U.min() and plan.U.max() <= 13.0
    assert np.isclose(plan.U.min(), -7.0) or np.isclose(plan.U.max(), 13.0)
    c.reset()
    assert c.belief.problem.bounds == pytest.approx((-7.0, 13.0))
    assert c.nominal.bounds == (-20.0, 20.0)


def test_a_drive_that_is_known_is_no_harm():
    """Without an estimator it must be made up for by the prediction and the bounds alone."""
    def run(drive):
        p = Plant(PendulumParameters(), LIMITS, PlantParameters(), TOLD)
        return measure(simulate(p, controller(estimator='none', drive=drive), 10.0)).success
    assert run(Drive.of(TOLD))
    assert not run(DIRECT)


@pytest.mark.parametrize(('solver', 'seed'), [('mppi', 10), ('mppi', 16), ('ilqr', 13)])
def test_at_five_ticks_a_step_it_is_swung_up_as_at_one(solver, seed):
    """Interpolated from tick to tick, a plan lost its edges; then link 2 went on spinning."""
    metrics = measure(simulate(plant(rate=100.0), controller(solver, seed), 4.0))
    assert metrics.success and metrics.settling_time < 3.0


@pytest.mark.parametrize('seed', [0, 4])
def test_three_links_are_swung_up_by_forces_that_act_sooner_or_later(seed, rng):
    """Plans then begin between the steps of those before, by less than a millisecond."""
    pendulum, c = (make({'links': 3, 'seed': seed})
                   for make in (plants.plant, controllers.controller))
    for n in range(55):
        delay = 0.011 + 0.0007 * rng.normal()
        force = c.update(pendulum.t, pendulum.x, delay).first_force(c.belief.problem.u_max)
        pendulum.advance(delay)
        pendulum.obey(force)
        pendulum.advance(0.05 * (n + 1) - pendulum.t)
    assert is_upright(to_turn_of(pendulum.x, c.belief.problem.x_r) - c.belief.problem.x_r)


def test_an_encoder_that_wraps_changes_nothing():
    def run(wrap):
        c, x, forces = controller('ddp'), np.array([0.0, 3.1, 3.1, 0.0, 1.0, 1.0]), []
        for n in range(6):
            seen = x.copy()
            if wrap:
                seen[angles(x)] = (seen[angles(x)] + np.pi) % (2 * np.pi) - np.pi
            plan = c.update(0.05 * n, seen)
            np.testing.assert_allclose(c.belief.x, x, atol=0.01)
            assert c.belief.estimate.refused == 0
            forces.append(plan.U[0])
            x = plan.X[1]
        return forces
    np.testing.assert_allclose(run(True), run(False), rtol=1e-6)


@pytest.mark.parametrize('bad', [np.full(6, np.nan), np.zeros(5), np.full(6, np.inf)])
def test_a_state_without_numbers_is_refused(bad):
    with pytest.raises(ValueError, match='expected 6 finite numbers'):
        controller().update(0.0, bad)


def test_without_a_measurement_the_last_plan_goes_on():
    c = controller()
    plan = c.update(0.0, FALLING)
    fallback = c.fallback(0.05)
    assert fallback.stats.status is Status.LAST_POLICY
    np.testing.assert_allclose(fallback.U[:29], plan.U[1:], atol=1e-9)
    assert c.update(0.1, plan.X[2]).stats.status is Status.CONVERGED


def test_without_anything_the_force_is_zero():
    plan = controller().fallback(0.0)
    assert plan.stats.status is Status.ZERO
    np.testing.assert_array_equal(plan.U, 0.0)


def test_a_failed_solve_falls_back_to_the_policy(monkeypatch):
    c = controller(estimator='none')
    before = c.update(0.0, FALLING)
    fail(c, monkeypatch)
    plan = c.update(0.05, before.X[1])
    assert plan.stats.status is Status.LAST_POLICY
    np.testing.assert_allclose(plan.U[0], before.U[1], atol=1e-9)


def test_then_to_the_regulator_near_the_goal_and_to_zero_elsewhere(monkeypatch):
    c = controller(horizon=60)
    fail(c, monkeypatch)
    plan = c.update(0.0, np.array([0.0, 0.02, 0.01, 0.0, 0.0, 0.0]))
    assert plan.stats.status is Status.REGULATOR
    assert np.abs(plan.X[-1]).max() < 0.1
    c.reset()
    fail(c, monkeypatch)
    assert c.update(0.0, hanging()).stats.status is Status.ZERO


def test_what_is_carried_over_counts_from_when_the_last_state_s_force_acts():
    c = controller(estimator='none', carry_over=0.2)
    c.update(0.0, FALLING, delay=0.1)
    assert c.fallback(0.29).stats.status is Status.LAST_POLICY
    assert c.fallback(0.31).stats.status is Status.ZERO


def fail(c, monkeypatch):
    """Make the next solve end without a usable plan, as one from a state beyond numbers does."""
    lost = c.planner.solver.solve(BEYOND, None, np.inf)
    assert not lost.usable
    monkeypatch.setattr(c.planner.solver, 'solve', lambda x_0, warm_start, deadline: lost)


def test_a_state_that_cannot_be_is_predicted_through():
    c = controller(estimator='none')
    expected = hold(fine(c), FALLING, c.update(0.0, FALLING).U[0], 0.05)
    plan = c.update(0.05, BEYOND)
    assert 'the velocity of joint1 is 1e+200 rad/s; expected at most 100' in c.belief.rejection
    np.testing.assert_allclose(plan.X[0], expected, atol=1e-12)
    c.update(0.1, plan.X[1])
    assert not c.belief.rejection


def test_a_first_state_that_cannot_be_gets_zero():
    c = controller()
    assert c.update(0.0, BEYOND).stats.status is Status.ZERO
    assert c.update(0.05, FALLING).U[0] != 0.0


def constant_outlier(n, x):
    return np.where(np.arange(6) == 1, 1e6, x)


def stuck_joint(n, x):
    return np.where(np.arange(6) == 1, 1.0, x)


def random_outlier(n, x):
    return x + np.random.default_rng(n).normal(0.0, 5.0, 6)


def not_a_number(n, x):
    return np.where(np.arange(6) == 1, np.nan, x)


def silence(n, x):
    return None


class Frozen:
    """Repeats the first state that it gets."""

    def __init__(self):
        self.x = None

    def __call__(self, n, x):
        self.x = x.copy() if self.x is None else self.x
        return self.x


def answer(c, t, x):
    """Answer as the node does: by the fallback where there is no state, or none of numbers."""
    if x is None:
        return c.fallback(t)
    try:
        return c.update(t, x)
    except ValueError:
        return c.fallback(t)


# in the swing-up, with another one after it, and upright
@pytest.mark.parametrize(('begins', 'after'), [(16, 240), (100, 0)])
@pytest.mark.parametrize('fault', [constant_outlier, stuck_joint, random_outlier, not_a_number,
                                   silence, Frozen])
@pytest.mark.parametrize('name', sorted(SOLVERS))
def test_a_dead_sensor_ends_in_zero_force_and_a_new_swing_up(name, fault, begins, after):
    c, p, ends = controller(name), plant(), begins + 30
    broken = Frozen() if fault is Frozen else fault
    forces, upright = [], []
    for n in range(ends + after):
        x = p.measure().x
        force = answer(c, p.t, broken(n, x) if begins <= n < ends else x).first_force(20.0)
        p.obey(force)
        p.advance(0.05)
        forces.append(force)
        upright.append(bool(is_upright(p.x)))
    # the last good state came a period before the first bad one
    assert not np.any(forces[begins + 5:ends]), forces[begins:ends]
    assert any(forces[begins:begins + 4])
    assert all(upright[ends + 200:])   # which is from anywhere, by chance; see scenario random


def test_a_sensor_that_stands_still_with_the_pendulum_is_believed():
    c = controller(estimator='none')
    for n in range(20):
        assert c.update(0.05 * n, np.zeros(6)).stats.status is Status.CONVERGED
        assert not c.belief.rejection


def test_a_jump_is_no_dead_sensor():
    """Somebody takes the pendulum elsewhere: the filter begins anew before patience ends."""
    c, x = controller(), LEANING
    for n in range(12):
        x = x + (0, 1.0, 0.5, 0, 0, 0) if n == 5 else x
        plan = c.update(0.05 * n, x)
        assert plan.stats.status is not Status.ZERO
        x = hold(c.nominal.model._replace(h=0.005), x, plan.first_force(20.0), 0.05)
    assert not c.belief.rejection


@pytest.mark.parametrize('name', ['ilqr', 'mppi'])
def test_a_reset_and_a_clock_that_goes_back_begin_a_run_that_is_the_same(name):
    c = controller(name)

    def run():
        return np.array([c.update(0.05 * n, FALLING * (1 + 0.1 * n)).U for n in range(3)])
    first = run()
    np.testing.assert_array_equal(run(), first)    # the clock went back
    c.reset()
    np.testing.assert_array_equal(run(), first)


def test_a_late_measurement_is_no_new_run():
    """After a stall the next state is less old, so its force acts before the last one was to."""
    c = controller()
    c.update(0.0, LEANING)
    c.update(0.05, LEANING, delay=0.2)
    assert c.update(0.10, LEANING, delay=0.003).stats.status is Status.CONVERGED
    ends, _ = c.commands.since(-1.0, 0.0)
    assert ends - 1.0 == pytest.approx([0.0, 0.103, math.inf])   # the second one never acts


@pytest.mark.parametrize('estimator', ['none', 'ekf'])
def test_a_state_that_a_later_one_overtook_adds_nothing(estimator):
    def run(overtaken):
        c = controller(estimator=estimator)
        x = LEANING
        for n in range(8):
            plan = c.update(0.05 * n, x)
            if overtaken and n == 5:    # in place of the real answer, which begins at 0.25 s
                c.commands.times = c.commands.times[:-1]
                c.commands.forces = c.commands.forces[:-1]
                plan = c.update(0.05 * (n - 1), FALLING, delay=0.05)
                assert c.belief.t == 0.25
            x = plan.X[1]
        return plan.U
    np.testing.assert_allclose(run(True), run(False), atol=0.05)


def test_a_repeated_state_adds_nothing():
    c = controller()
    c.update(0.0, LEANING)
    c.update(0.05, 1.1 * LEANING)
    known = c.observer.estimator.P
    plan = c.update(0.05, FALLING)
    assert c.observer.estimator.P is known
    np.testing.assert_array_equal(plan.X[0], c.commands.compensate(c.belief, 0.05))


def test_of_two_forces_the_one_sent_later_acts():
    forces = SentCommands()
    for begins, force in ((0.0, 1.0), (0.20, 2.0), (0.15, 3.0)):
        forces.add(begins, force)
    ends, commands = forces.since(0.1, 0.5)
    np.testing.assert_allclose(ends, [-0.1, 0.05, math.inf])
    np.testing.assert_array_equal(commands, [0.0, 1.0, 3.0])


def test_an_outlier_does_not_reach_the_plan():
    c, x = controller(), LEANING
    for n in range(6):
        seen = x + (0, 0, 1.0, 0, 0, 0) if n == 4 else x
        plan = c.update(0.05 * n, seen)
        x = hold(c.nominal.model._replace(h=0.005), x, plan.first_force(20.0), 0.05)
        assert np.abs(plan.X[0, 1:3]).max() < 0.05
    assert c.belief.estimate.refused == 1


def test_a_lost_state_is_predicted_through():
    c, x = controller(), LEANING
    model = c.nominal.model._replace(h=0.005)
    for n in range(8):
        lost = n in (3, 4)
        plan = c.fallback(0.05 * n) if lost else c.update(0.05 * n, x)
        assert plan.stats.status is (Status.LAST_POLICY if lost else Status.CONVERGED)
        if n == 5:
            np.testing.assert_allclose(c.belief.estimate.innovation, 0.0, atol=1e-5)
        x = hold(model, x, plan.first_force(20.0), 0.05)
    assert np.abs(x[1:3]).max() < 0.05


def test_links_stand_where_they_are_balanced():
    """Wherever their encoders have zero, or their mass is beside the line of the joints."""
    c, x, balance = controller(), hanging(), np.array([0.04, -0.06])
    model, rejections = Model(Pendulum.of(c.nominal.physical), INTEGRATORS['rk4'], 0.005), set()
    for n in range(120):
        plan = c.update(0.05 * n, turned(x, balance))
        rejections.add(c.belief.rejection)
        x = hold(model, x, plan.first_force(20.0), 0.05)
    assert rejections == {''}
    assert c.belief.balance == pytest.approx(balance, abs=2e-3)
    assert np.abs(wrapped(x)).max() < 0.02
    # an encoder that stands still does so in balance, which is not where it has zero
    for n in range(120, 125):
        c.update(0.05 * n, turned(np.zeros(6), balance))
        assert 'stood still' not in c.belief.rejection


@pytest.mark.parametrize('turn', [0.0, 2 * math.pi])
def test_links_with_springs_are_held_where_they_can_rest_on_their_turn(turn):
    c = controllers.controller({
        'joint1_stiffness': 0.3, 'joint2_stiffness': 0.1, 'joint1_preload': 0.9})
    problem, x = c.nominal, np.array([0.2, turn, turn, 0.0, 0.0, 0.0])
    for n in range(100):
        plan = c.update(0.05 * n, x)
        x = hold(problem.model._replace(h=0.005), x, plan.first_force(20.0), 0.05)
    assert problem.is_reached(x) and np.abs(x[1] - turn) > 0.1
    rest = problem.with_goal_on(turns_of(problem, x))[0].x_r
    np.testing.assert_allclose(x, rest, atol=0.02)
    assert abs(plan.U[0]) < 0.1


def test_springs_that_are_wound_up_are_unwound():
    """Periodic costs take every turn for upright, but springs leave a goal on few."""
    c = controllers.controller({'joint1_stiffness': 0.3, 'joint2_stiffness': 0.3})
    problem, x = c.nominal, np.array([0.0, 3 * 2 * math.pi, 3 * 2 * math.pi, 0.0, 0.0, 0.0])
    assert problem.on_turn_of(x) is None and not problem.is_reached(x)
    for n in range(160):
        plan = c.update(0.05 * n, x)
        x = hold(problem.model._replace(h=0.005), x, plan.first_force(20.0), 0.05)
    assert problem.is_reached(x)


def test_a_pendulum_that_differs_is_solved_for():
    c = controller()
    physical = replace(c.nominal.physical, link2_mass=0.6)
    model = Model(Pendulum.of(physical), INTEGRATORS['rk4'], 0.005)
    x = np.array([0.0, 2.0, 2.5, 0.0, 1.0, -1.0])
    for n in range(40):
        plan = c.update(0.05 * n, x)
        x = hold(model, x, plan.first_force(20.0), 0.05)
    # with twice of all masses and the gain the motion is the same, and who of them has which
    # share of the moments does not show
    found, true = (Pendulum.of(each) for each in (c.belief.problem.physical, physical))
    for one, other in ((found.m, true.m), (found.a, true.a), (found.b[0], true.b[0]),
                       (found.b[1], true.b[1])):
        assert np.array(one) / c.belief.drive.gain == pytest.approx(np.array(other), rel=0.02)
    assert c.belief.problem.model == Model(
        Pendulum.of(c.belief.problem.physical, scale=c.nominal.scale), INTEGRATORS['rk4'], 0.05)
    assert c.planner.solver.problem is c.belief.problem
    c.reset()
    assert c.belief.problem is c.nominal


def test_warming_up_changes_nothing():
    cold, warm = controller('mppi'), controller('mppi')
    warm.warm_up()
    np.testing.assert_array_equal(warm.update(0.0, FALLING).U, cold.update(0.0, FALLING).U)


def test_after_warming_up_no_tick_compiles_or_loads(tmp_path):
    """Nor does its report: kernels are compiled by their first call with arguments of a kind."""
    code = f"""
import os, sys
from numba.core.dispatcher import Dispatcher
from controllers import controller, plant
from dp_swing_ros.runtime.report import tick_report

def compiled():
    return {{kernel.py_func.__qualname__: len(kernel.overloads)
            for name, module in list(sys.modules.items()) if name.startswith('dp_swing_ros')
            for kernel in vars(module).values() if isinstance(kernel, Dispatcher)}}

for solver in {sorted(SOLVERS)}:   # each in a process that has compiled nothing
    child = os.fork()
    if not child:
        break
    _, code = os.waitpid(child, 0)
    assert code == 0, solver
else:
    sys.exit()

c, p = controller(solver), plant(delay=0.02)
p.advance(0.05)
p.reset()
c.warm_up()
before, modules = compiled(), set(sys.modules)
for n in range(60):
    measured = p.measure()
    if measured is None or n == 20:
        plan = c.fallback(p.t)
    else:
        plan = c.update(measured.t, measured.x + (n == 30), 0.02)
    tick_report(plan, c.belief.problem, c.belief.estimate, delay=0.0, force=0.0,
                real_time=True, carried=0, resets=0, number=n)
    p.obey(plan.first_force(20.0))
    p.advance(0.05)
assert len(before) > 30, before
print(solver, sorted(name for name, count in compiled().items() if count != before[name]) +
      sorted(set(sys.modules) - modules))
"""
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True, cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(
            [str(Path(__file__).parents[1]), *sys.path])})
    assert done.stdout.splitlines() == [f'{solver} []' for solver in sorted(SOLVERS)]


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_tick_that_a_deadline_cut_short_can_be_repeated(solver):
    live, again = (controllers.controller({'solver': solver}) for _ in range(2))
    live.warm_up()
    x, counts = hanging(), []
    for n, share in enumerate((1.0, 0.1, 0.5, 0.3, -1.0)):
        # from all the time that it takes to none
        plan = live.update(0.05 * n, x, 0.003, time.perf_counter() + 0.004 * share)
        again.planner.search = repeated(plan.stats.solves)
        twin = again.update(0.05 * n, x, 0.003)
        assert np.array_equal(plan.X, twin.X) and np.array_equal(plan.U, twin.U)
        assert twin.stats.solves == plan.stats.solves
        counts.append(plan.stats.solves)
        x = plan.X[1]
    assert counts[-1] == (0,)


def test_the_next_tick_goes_by_the_force_that_was_sent():
    x = hanging()
    own, other = controller(estimator='none'), controller(estimator='none')
    sent, _ = [float(c.update(0.0, x).U[0]) for c in (own, other)]
    own.commands.replace_last(sent)
    other.commands.replace_last(-7.0)
    x = x + (0, 0, 0, 0.1, 0, 0)
    for c, force in ((own, sent), (other, -7.0)):
        plan = c.update(1 / 64, x, 1 / 64)
        np.testing.assert_allclose(plan.X[0], hold(fine(c), x, force, 1 / 64), rtol=1e-14)


def test_a_failed_solve_tells_how_far_it_came():
    c = controller(estimator='none')
    c.observer.message_filter.range[:] = np.inf
    plan = c.update(0.0, np.array([0.0, 0.0, 0.0, 1e200, 0.0, 0.0]))
    assert plan.stats.status is Status.ZERO
    assert len(plan.stats.solves) >= 1


@pytest.mark.parametrize('kept', [(), (3,)])   # velocities that are measured
def test_velocities_need_not_be_measured(kept):
    p, c = plant(), controller()
    for n in range(80):
        x = p.x.copy()
        x[[i for i in range(3, 6) if i not in kept]] = np.nan
        p.obey(c.update(0.05 * n, x).first_force(20.0))
        assert not c.belief.rejection
        p.begin_period(0.0)
        p.advance(0.05)
    assert is_upright(p.x)
    np.testing.assert_allclose(c.belief.estimate.x[3:], p.x[3:], atol=0.1)


@pytest.mark.parametrize(('estimator', 'x', 'words'), [
    ('none', [*LEANING[:3], 0.0, 0.0, np.nan], 'without velocities; estimator ekf does without'),
    ('ekf', [np.nan, *LEANING[1:]], 'expected 6 finite numbers'),
    ('ekf', [*LEANING[:5], np.inf], 'expected 6 finite numbers')])
def test_what_must_be_measured_is_said(estimator, x, words):
    with pytest.raises(ValueError, match=words):
        controller(estimator=estimator).update(0.0, np.array(x))


def test_positions_alone_that_freeze_are_rejected():
    c, x = controller(), LEANING.copy()
    x[3:] = np.nan
    for n in range(10):
        c.update(0.05 * n, x)
    assert 'has stood still to the bit' in c.belief.rejection


def test_disabled_it_believes_states_and_sends_nothing():
    p, c = plant(), controller(enabled=False)
    for n in range(60):
        plan = c.update(0.05 * n, p.x)
        p.obey(plan.first_force(20.0))
        p.begin_period(0.0)
        p.advance(0.05)
        c.enable(n > 10)
        assert (plan.stats.status is Status.DISABLED) == (n <= 11)
        assert (plan.U[0] == 0.0) == (n <= 11)
    assert c.belief.estimate.refused == 0 and c.fallback(3.0).stats.status is Status.LAST_POLICY
    c.enable(False)
    assert c.fallback(3.0).stats.status is Status.DISABLED
    assert c.fallback(3.0).U[0] == 0.0


def test_where_a_learned_model_is_wild_a_tick_has_a_finite_force():
    """It is right about upright, and where its second link hangs that weighs less than nothing."""
    chain = of_chain(PendulumParameters())
    inertia = chain.inertia.copy()
    inertia[5, [0, 3]] = np.array((0.75, 0.25)) * chain.inertia[5, 0]   # of D_22: 1 and cos θ_2
    wild = replace(model_of(chain._replace(inertia=inertia)), drive=Drive(0.05, 0.05))
    c = controllers.controller({'dynamics': 'learned', 'model': wild.to_text(),
                                'estimator': 'none'})
    hanging = np.array([0.0, np.pi, np.pi, 0.0, 0.0, 9.0])
    for n, x in enumerate((np.zeros(6), hanging, hanging)):
        with np.errstate(all='ignore'):
            plan = c.update(0.05 * n, x)
            ahead = c.commands.compensate(c.belief, 0.05 * n)
        assert np.isfinite(ahead).all() == (n == 0)
        assert np.all(np.isfinite(plan.U)) and np.abs(plan.U).max() <= 20.0
        assert (plan.stats.status.name in ('ZERO', 'LAST_POLICY', 'REGULATOR')) == (n > 0)


def test_what_was_disabled_between_two_ticks_begins_with_a_first_plan():
    c = controller()
    plan = c.update(0.0, FALLING)
    assert c.enable(False) and c.enable(True)
    assert len(c.update(0.05, plan.X[1]).stats.candidates) == c.parameters.first_starts
