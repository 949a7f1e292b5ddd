# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node in a thread of this process: as one in its own, without the seconds that takes."""

from contextlib import ExitStack, nullcontext
import gc
from importlib import import_module
import json
import os
import sys
import tempfile
import threading
from unittest.mock import patch

from conftest import PATIENCE, wait_until
import pytest
from rclpy import utilities

from dp_swing_ros.nodes import process


class Output:
    """
    What this process prints while it is open, the libraries in C too.

    pytest's own capture forgets what is printed while another thread reads what was before.
    """

    def __enter__(self):
        sys.stdout.flush()
        sys.stderr.flush()
        self.file = tempfile.TemporaryFile('a+b', buffering=0)
        self.before = [os.dup(each) for each in (1, 2)]
        self.stack = ExitStack()
        for place, name in ((1, 'stdout'), (2, 'stderr')):
            os.dup2(self.file.fileno(), place)
            stream = self.stack.enter_context(os.fdopen(os.dup(place), 'w', buffering=1))
            self.stack.enter_context(patch.object(sys, name, stream))
        return self

    def __exit__(self, *error):
        self.stack.close()
        for place, before in zip((1, 2), self.before):
            os.dup2(before, place)
            os.close(before)
        self.last = self.text()
        self.file.close()

    def text(self):
        """Return all of it so far."""
        if self.file.closed:
            return self.last
        size = os.fstat(self.file.fileno()).st_size
        return os.pread(self.file.fileno(), size, 0).decode(errors='replace')


class NodeHere:
    """A node, or one of a script, that its `main` runs in a thread; one at a time."""

    def __init__(self, name, parameters=(), arguments=()):
        given = [word for key, value in dict(parameters).items()
                 for word in ('-p', f'{key}:={json.dumps(value)}')]
        ros = ['--ros-args', *given, *arguments] if given or arguments else []
        script = name.removesuffix('.py')
        main = import_module(script if script != name else f'dp_swing_ros.nodes.{name}').main
        self.handlers, self.stack, self.code = [], ExitStack(), None
        self.printed = self.stack.enter_context(Output())
        # a context of its own, whatever a test before has left
        self.stack.enter_context(patch.object(utilities, 'g_default_context', None))
        for whose, what, instead in ((process, 'on_signals_to_node', self.handlers.append),
                                     # nobody else ends at the moment
                                     (process, 'exit_after', lambda *_: nullcontext()),
                                     # nor does a test's process end with it
                                     (process, '_leave', lambda node: None),
                                     # nor do tests give way to others, as a console does
                                     (os, 'nice', lambda by: by)):
            self.stack.enter_context(patch.object(whose, what, instead))
        self.stack.enter_context(patch.object(sys, 'argv', [name, *ros]))
        self.stack.callback(gc.unfreeze)   # what an mpc has frozen
        self.stack.enter_context(patch.object(sys, 'unraisablehook', sys.unraisablehook))
        self.thread = threading.Thread(target=self.run, args=(main, sys.argv), daemon=True)
        self.thread.start()

    def run(self, main, arguments):
        self.code = main(arguments)
        if self.code:   # one that failed while it was made is left to the end of its process
            for each in gc.get_objects():
                if issubclass(type(each), process.ProcessNode) and not each.context.ok():
                    each.destroy_node()

    def output(self):
        """Return all that was printed so far."""
        return self.printed.text()

    complaint = output

    def ended(self):
        """Return whether it has ended."""
        return not self.thread.is_alive()

    def wait_for(self, text, timeout=PATIENCE):
        """Wait until it prints the text; fail if it ends or is silent instead."""
        wait_until(lambda: text in self.output() or self.ended(), timeout)
        assert text in self.output(), f'{text!r} not in: {self.output()}'

    def wait(self, timeout=PATIENCE):
        """Wait for its end and return the exit code."""
        self.thread.join(timeout)
        self.stack.close()
        assert self.ended()
        return self.code

    def ask_to_end(self):
        """Do what a signal does, once it runs."""
        wait_until(lambda: self.handlers or self.ended())
        for handle in self.handlers:
            handle()

    def stop(self):
        """Do what a signal does, and return the exit code."""
        self.ask_to_end()
        return self.wait()


@pytest.fixture
def start_here():
    """Return a function that starts a node in this process; in the end none is left."""
    started = []

    def start(name, parameters=(), arguments=()):
        started.append(NodeHere(name, parameters, arguments))
        return started[-1]
    yield start
    for node in reversed(started):
        if node.ended():
            node.wait()   # which puts back what it has replaced
        else:
            node.stop()
