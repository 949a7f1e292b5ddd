# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node in a thread of this process: as one in its own, without the seconds that takes."""

from contextlib import ExitStack, nullcontext
import gc
from importlib import import_module
import json
import sys
import threading
from unittest.mock import patch

from conftest import PATIENCE, wait_until
from one_process import COMMIT
from rclpy import utilities

from dp_swing_ros.nodes import process, ros_parameters


class NodeHere:
    """A node, or one of a script, that its `main` runs in a thread; one at a time."""

    def __init__(self, capfd, name, parameters=(), arguments=()):
        given = [word for key, value in dict(parameters).items()
                 for word in ('-p', f'{key}:={json.dumps(value)}')]
        ros = ['--ros-args', *given, *arguments] if given or arguments else []
        script = name.removesuffix('.py')
        main = import_module(script if script != name else f'dp_swing_ros.nodes.{name}').main
        self.capfd, self.text, self.handlers = capfd, '', []
        self.stack, self.code = ExitStack(), None
        self.stack.enter_context(patch.object(ros_parameters, 'commit', COMMIT))
        # a context of its own, whatever a test before has left
        self.stack.enter_context(patch.object(utilities, 'g_default_context', None))
        for what, instead in (('on_signals_to_node', self.handlers.append),
                              # nobody else ends at the moment
                              ('exit_after', lambda *_: nullcontext())):
            self.stack.enter_context(patch.object(process, what, instead))
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
        self.text += ''.join(self.capfd.readouterr())
        return self.text

    complaint = output

    def ended(self):
        """Return whether it has ended."""
        return not self.thread.is_alive()

    def wait_for(self, text, timeout=PATIENCE):
        """Wait until it prints the text; fail if it ends or is silent instead."""
        wait_until(lambda: text in self.output() or self.ended(), timeout)
        assert text in self.output(), f'{text!r} not in: {self.text}'

    def wait(self, timeout=PATIENCE):
        """Wait for its end and return the exit code."""
        self.thread.join(timeout)
        assert self.ended()
        self.stack.close()
        return self.code

    def stop(self):
        """Do what a signal does, once it runs; return the exit code."""
        self.handlers[0]()
        return self.wait()
