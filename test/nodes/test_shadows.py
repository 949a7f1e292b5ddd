# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Solvers in the shadow of the one that is obeyed, as processes that nobody waits for."""

import os
from pathlib import Path
import signal

import numpy as np
import pytest
from std_srvs.srv import Trigger
from test_live import put
from test_mpc import Conversation, LEANING

from dp_swing_ros.messages.fields import from_diagnostics
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.topics import DIAGNOSTICS, JOINT_STATES


def answers(messages, solver):
    """Return what a shadow reported, by the number of the tick."""
    found = [from_diagnostics(each, f'mpc: shadow {solver}') for each in messages]
    return {int(each.values['number']): each.values for each in found
            if each is not None and 'number' in each.values}


def children(pid):
    """Return the processes that a process has begun, by what they run."""
    found = {}
    for folder in Path('/proc').iterdir():
        try:
            if folder.name.isdigit() and int(
                    (folder / 'stat').read_text().rsplit(')', 1)[1].split()[1]) == pid:
                found[int(folder.name)] = (folder / 'cmdline').read_text()
        except OSError:
            pass   # it has ended
    return found


def shadow_processes(talk):
    """Return the shadows of an mpc by their numbers of process."""
    return [pid for pid, line in children(talk.node.popen.pid).items() if 'rerun.shadow' in line]


@pytest.mark.parametrize('solver', ['ilqr', 'ddp', 'mppi'])
def test_a_solver_has_no_regret_about_itself(peer, start_node, solver):
    """Not in the last bit, through changes of parameters and a reset, with a state missing."""
    talk = Conversation(peer, start_node, {'solver': solver, 'shadow': [solver]})
    for n in range(4):
        talk.send(hanging() + 1e-3 * n)
    assert put(peer, force_weight=0.01, horizon=25) == ''
    talk.send(hanging() + 4e-3)
    talk.send([np.nan] * 6)
    assert peer.call(Trigger, 'mpc/reset').success
    for n in range(3):
        talk.send(hanging() + 1e-3 * (n + 7))
    talk.report()
    assert peer.until(lambda: len(answers(talk.reports, solver)) == 9)
    told = answers(talk.reports, solver)
    assert [told[n]['regret'] for n in sorted(told)] == [0.0] * 9
    assert [told[n]['force'] for n in sorted(told)] == [force.data for force in talk.forces]


def test_shadows_answer_each_tick_and_change_nothing(peer, start_node):
    def forces(shadow):
        talk = Conversation(peer, start_node, {'shadow': shadow, 'seed': 3})
        sent = [talk.send(hanging() + 1e-3 * n) for n in range(5)]
        assert peer.until(lambda: all(
            len(answers(talk.reports, solver)) == 5 for solver in shadow if solver))
        assert len(shadow_processes(talk)) == len([one for one in shadow if one])
        told = [answers(talk.reports, solver) for solver in shadow]
        assert talk.node.stop() == 0
        return sent, told
    alone, _ = forces([''])
    followed, told = forces(['ddp', 'mppi'])
    assert followed == alone
    for of_solver in told:
        assert set(of_solver) == {1, 2, 3, 4, 5}
    assert any(each['regret'] != 0 for each in told[1].values())


def test_in_real_time_they_follow_the_newest_tick(peer, start_node):
    reports, states = peer.record(DIAGNOSTICS), peer.record(JOINT_STATES)
    start_node('mpc', {'shadow': ['ddp']}).wait_for('ready')
    start_node('plant')
    assert peer.until(lambda: len(states) > 40)
    assert peer.until(lambda: len(answers(reports, 'ddp')) > 30)
    told = answers(reports, 'ddp')
    assert max(each['behind'] for each in told.values()) <= 20
    assert all(each['solve_time'] > 0 for each in told.values())


def test_shadows_come_and_go_while_it_runs(peer, start_node):
    talk = Conversation(peer, start_node)
    talk.send(LEANING)
    assert put(peer, shadow=['lqr']) != ''
    assert put(peer, shadow=['mppi']) == ''
    talk.send(LEANING + 1e-3)
    assert peer.until(lambda: shadow_processes(talk))
    process, = shadow_processes(talk)
    talk.send(LEANING + 2e-3)     # which in lockstep waits until it is ready
    assert peer.until(lambda: answers(talk.reports, 'mppi'))
    assert os.sched_getscheduler(process) == os.SCHED_IDLE
    os.kill(process, signal.SIGKILL)
    talk.send(LEANING + 3e-3)
    talk.node.wait_for('the shadow mppi has ended with exit code -9; going on without it')
    talk.send(LEANING + 4e-3)
    assert put(peer, shadow=['mppi', 'ddp']) == ''
    talk.send(LEANING + 5e-3)
    assert peer.until(lambda: len(shadow_processes(talk)) == 2)
    assert put(peer, shadow=['']) == ''
    talk.send(LEANING + 6e-3)
    assert peer.until(lambda: not shadow_processes(talk))
    assert talk.node.stop() == 0


def test_a_shadow_outlives_nobody(peer, start_node):
    talk = Conversation(peer, start_node, {'shadow': ['ddp']})
    talk.send(LEANING)
    process, = shadow_processes(talk)
    talk.node.stop(signal.SIGKILL)
    assert peer.until(lambda: not Path(f'/proc/{process}').exists())


def test_an_unknown_solver_is_refused(start_node):
    node = start_node('mpc', {'shadow': ['lqr']})
    assert node.wait() == 2
    assert "parameter 'shadow' is ('lqr',); expected each one of ddp, ilqr" in node.output()
