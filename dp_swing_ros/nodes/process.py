# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The life of a node's process: start, spin, last words, exit code.

rclpy's own signal handling ends the context at once, before a node can send a last safe command
or finish a file. Here a signal only ends the loop; `close` then runs with everything still alive.
"""

from collections.abc import Callable, Iterator
from concurrent import futures
from contextlib import contextmanager
import ctypes
from functools import partial
import os
from pathlib import Path
import re
import resource
import sys
import tempfile
import threading
import time
import traceback
from typing import Any, TypeVar

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from rclpy.utilities import remove_ros_args
from std_srvs.srv import SetBool, Trigger

from dp_swing_ros import environment
from dp_swing_ros.errors import failure, UserError
from dp_swing_ros.executables import on_signals_to_node
from dp_swing_ros.nodes.fast_lane import FastLane
from dp_swing_ros.nodes.ros_parameters import check_given, refuse_unknown
from dp_swing_ros.nodes.taking import Executor
from dp_swing_ros.parameters import ParameterError

CLOCK = '/clock'
AWAY, COMPILING = 2.0, 60.0   # [s] at most for what is made aside; longer where it may compile
SWITCHING = 5e-4  # [s] after which a thread that makes something lets the ticks go on
POLL = 0.05  # [s] a signal is seen after this time at the latest
DELIVERY = 3.0  # [s] at most for the last messages to arrive
TEARDOWN = 2  # [s] at most for the middleware's end

CLOCK_MONOTONIC, SIGEV_THREAD = 1, 2  # of Linux
OK, FAILED, MISUSED = 0, 1, 2  # exit codes
STEADY = Clock(clock_type=ClockType.STEADY_TIME)

Made = TypeVar('Made')


class ProcessNode(Node):
    """A node that a process is made for. It sets `done` to end the process itself."""

    done: bool = False
    linger: float = 0.0  # [s] callbacks go on for this time after the end
    delivery: float = DELIVERY     # [s] at most for its last messages, where it ends by itself
    thread_priority: int = 0       # once it is prepared: see SchedulingParameters
    fast_lane: FastLane | None = None   # for what must not wait, if anything does
    background: futures.Future[Any] | None = None   # what a thread makes

    def prepare(self) -> None:
        """Do long work before the first message; a signal ends it there, and nothing unwinds."""

    def may_end(self) -> bool:
        """Return whether it may end now; asked from a signal on, until it may."""
        return True

    def close(self) -> None:
        """Send the last command and finish files; called once, whatever ended the process."""

    @property
    def pace_clock(self) -> Clock:
        """Return the clock that nobody sets: /clock with use_sim_time, else a steady one."""
        return self.get_clock() if self.get_parameter('use_sim_time').value else STEADY

    def use_fast_lane(self, subscription: Subscription, *others: Timer) -> None:
        """Take what must not wait past the executor, where it comes often or that is held up."""
        clock = [each for each in self.subscriptions if each.topic_name == CLOCK]
        self.fast_lane = FastLane(self.context, subscription, *clock, *others)

    def made_in_background(self, make: Callable[[], Made], patience: float = AWAY,
                           waits: bool = False) -> Made:
        """
        Return what is made in a thread while what must not wait is served, unless time `waits`.

        Raises what `make` raises, or ParameterError where it takes longer than a time [s].
        """
        if self.background is not None and not self.background.done():
            raise ParameterError('what was asked for before is still being made; try again later')
        sys.setswitchinterval(SWITCHING)
        made: futures.Future[Made] = futures.Future()
        self.background, end = made, time.monotonic() + patience
        threading.Thread(target=_fulfil, args=(made, make), daemon=True).start()
        while not made.done() and time.monotonic() < end:
            if self.fast_lane is None or waits:
                futures.wait([made], patience)
            else:
                self.call_back(self.fast_lane.serve_once)
        if not made.done():
            raise ParameterError(f'what was asked for is not there after {patience:g} s')
        return made.result()

    def call_back(self, spin: Callable[[], None]) -> None:
        """Let callbacks come; one that fails ends nothing, but for what the user can put right."""
        try:
            spin()
        except UserError:
            raise
        except Exception as error:
            self.on_failure(error)

    def on_failure(self, error: Exception) -> None:
        """Say that a callback failed, and go on."""
        self.get_logger().error(f'{failure(error)}; going on', throttle_duration_sec=1.0)

    def every(self, period: float, callback: Callable[[], None]) -> Timer:
        """Call back once in a period [s] of the steady clock."""
        return self.create_timer(period, callback, clock=STEADY)

    def serve(self, name: str, act: Callable[[], tuple[bool, str]]) -> None:
        """Offer a service that answers with success and message of what it does."""
        def answer(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = self.answer_of(act)
            return response
        self.create_service(Trigger, name, answer)

    def serve_switch(self, name: str, act: Callable[[bool], tuple[bool, str]]) -> None:
        """Offer a service that is asked for true or false, and answers as those of `serve`."""
        def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
            response.success, response.message = self.answer_of(partial(act, request.data))
            return response
        self.create_service(SetBool, name, answer)

    def answer_of(self, act: Callable[[], tuple[bool, str]]) -> tuple[bool, str]:
        """Return success and message of what a service does, also where it fails."""
        try:
            return act()
        except Exception as error:
            self.on_failure(error)
            return False, failure(error)


def _fulfil(made: 'futures.Future[Made]', make: Callable[[], Made]) -> None:
    try:
        made.set_result(make())
    except BaseException as error:
        made.set_exception(error)


class _Signals:
    """SIGINT, SIGTERM and SIGHUP as a request to stop; a second one changes nothing."""

    def __init__(self) -> None:
        self.requested = False
        self.leave: Callable[[], object] | None = None   # at once, where nothing can be waited for
        on_signals_to_node(self._handle)

    def _handle(self, *_: Any) -> None:
        is_first, self.requested = not self.requested, True
        if is_first and self.leave is not None:
            self.leave()


def run(make_node: Callable[[], ProcessNode], args: list[str] | None = None) -> int:
    """
    Run a node until a signal comes or it is done, and return the exit code.

    `args` is as sys.argv, with the program's name first. What the user can put right is one line
    on standard error and exit code 2; any other failure a traceback and exit code 1.
    """
    args = sys.argv if args is None else args
    signals = _Signals()
    node, code = None, OK
    try:
        _initialise(args)
        with _errors_of_ros():
            node = make_node()
        _live(node, signals)
    except (ParameterError, UserError) as error:   # what the user can put right
        # rcl appends where in its own source it failed
        text = re.sub(r', at /\S+:\d+', '', ' '.join(str(error).split()))
        print(f'{Path(args[0]).name}: error: {text}', file=sys.stderr)
        code = MISUSED
    except BaseException:   # a library may even ask for the exit
        traceback.print_exc()
        code = FAILED
    _tear_down(node, code)
    return code


def _tear_down(node: ProcessNode | None, code: int) -> None:
    sys.stdout.flush()
    with exit_after(TEARDOWN, code):
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


def _leave(node: ProcessNode) -> None:
    """
    End the process in the middle of what a node prepares.

    What compiles is called back from C++, where an exception of a signal would be dropped, and
    LLVM go on without what it asked for.
    """
    code = FAILED
    try:
        _close(node)
        code = OK
    except BaseException:
        traceback.print_exc()
    finally:
        try:
            _tear_down(node, code)
        finally:
            os._exit(code)


def _initialise(args: list[str]) -> None:
    if not any(name in os.environ for name in ('HOME', 'ROS_HOME', 'ROS_LOG_DIR')):
        # rcl refuses to start without a place for its log files.
        os.environ['ROS_LOG_DIR'] = str(Path(tempfile.gettempdir(), f'ros_log_{os.getuid()}'))
    try:
        unexpected = remove_ros_args(args)[1:]
    except RuntimeError as error:
        check_given(args)
        raise UserError(f'{type(error).__name__}: {error}') from None
    if unexpected:
        raise UserError(f'unknown argument {unexpected[0]!r}; '
                        'parameters are given as: --ros-args -p name:=value')
    with _errors_of_ros():
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)


@contextmanager
def _errors_of_ros() -> Iterator[None]:
    """Raise what ROS finds wrong with what it was given as an error of the user."""
    try:
        yield
    except InvalidParameterTypeException as error:   # of a parameter that rclpy itself declares
        raise ParameterError(error) from None
    except RCLError as error:
        raise UserError(f'{error}; {environment.variables()}') from None


def _live(node: ProcessNode, signals: _Signals) -> None:
    def is_over() -> bool:
        return node.done or signals.requested and node.may_end()
    try:
        signals.leave = partial(_leave, node)
        try:
            if not signals.requested:   # before
                node.prepare()
        finally:
            signals.leave = None
        if not signals.requested:
            refuse_unknown(node, of_topics=True)   # which have all been made
            if node.thread_priority:
                _prioritise(node.thread_priority)
        with (executor := Executor()):   # whose own `with` tells another type
            executor.add_node(node)
            while not is_over():
                node.call_back(partial(_spin, node, executor, is_over))
            end = time.monotonic() + node.linger
            while (rest := end - time.monotonic()) > 0:
                node.call_back(partial(executor.spin_once, rest))
    finally:
        _close(node)


def _close(node: ProcessNode) -> None:
    node.close()
    # A publisher takes messages with it that nobody has confirmed yet, as the last command.
    limit = time.monotonic() + (node.delivery if node.done else DELIVERY)
    for publisher in node.publishers:
        publisher.wait_for_all_acked(Duration(seconds=max(0.0, limit - time.monotonic())))


def _spin(node: ProcessNode, executor: Executor, is_over: Callable[[], bool]) -> None:
    # in the gap between two messages that come often, whose next is not to wait
    hurries = node.fast_lane is not None and node.fast_lane.is_busy
    executor.spin_once(timeout_sec=0.0 if hurries else POLL)
    if node.fast_lane is not None:
        node.fast_lane.serve(is_over)


def _prioritise(priority: int) -> None:
    """Let this process's threads, those of the middleware too, go before other programs."""
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK   # what it starts from now on has time
    for thread in map(int, os.listdir('/proc/self/task')):
        try:
            os.sched_setscheduler(thread, policy, os.sched_param(priority))
        except ProcessLookupError:
            continue   # it has ended meanwhile
        except PermissionError:
            allowed = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
            raise UserError(
                f"parameter 'thread_priority' is {priority}; this user may have {allowed} at most "
                f'(ulimit -r). Allow more in /etc/security/limits.conf, as in "@realtime - rtprio '
                '99", or set it to 0') from None


class _Event(ctypes.Structure):
    """The C library's sigevent: call a function with a value in a thread of its own."""

    _fields_ = (('value', ctypes.c_void_p), ('signal', ctypes.c_int), ('notify', ctypes.c_int),
                ('function', ctypes.c_void_p), ('attributes', ctypes.c_void_p),
                ('reserved', ctypes.c_char * 32))


@contextmanager
def exit_after(seconds: int, code: int) -> Iterator[None]:
    """
    End the process with an exit code if what is inside takes longer than this time [s].

    Fast DDS 2.14 can deadlock when two processes end at the same moment: the end of a participant
    (DomainParticipant::set_listener, from rmw_destroy_node) spins for a lock whose holder, a
    callback on the end of the other's endpoints, waits for it. It spins with Python's interpreter
    lock, so no Python thread or signal handler can help: a timer of the C library calls _exit.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    event = _Event(value=code, notify=SIGEV_THREAD,
                   function=ctypes.cast(libc._exit, ctypes.c_void_p))
    timer = ctypes.c_void_p()
    if libc.timer_create(CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) != 0:
        raise OSError(ctypes.get_errno(), 'timer_create')
    times = (ctypes.c_long * 4)(0, 0, seconds, 0)   # itimerspec: no interval; first, in s and ns
    libc.timer_settime(timer, 0, times, None)
    try:
        yield
    finally:
        libc.timer_delete(timer)
