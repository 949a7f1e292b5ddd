# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node that ends, fails, or takes its time, as it is told."""

import ctypes
import dataclasses
from functools import partial
import sys
import time

from dp_swing_ros.errors import UserError
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import declare
from dp_swing_ros.parameters import named, parameter, Parameters


@dataclasses.dataclass(frozen=True)
class Example(Parameters):
    mode: str = parameter('idle', 'what to do')
    rate: float = parameter(20.0, 'a rate', unit='Hz', minimum=1.0)


class Dying:

    def __del__(self):
        print('dying', flush=True)
        time.sleep(2)


@ctypes.CFUNCTYPE(ctypes.c_int)
def called():
    """Be called back from C, where an exception is dropped and something returned instead."""
    print('called', flush=True)
    time.sleep(2)
    return 1


class ExampleNode(ProcessNode):

    linger = 0.2

    def __init__(self):
        super().__init__('example')
        self.mode = declare(self, named(Example))['mode']
        self.create_timer(0.01, self.tick)
        self.ticks, self.braked = 0, False

    def prepare(self):
        print('prepare', flush=True)
        if self.mode == 'prepare':
            time.sleep(60)
        if self.mode == 'bug':
            raise RuntimeError('oops')
        if self.mode == 'destructor':
            Dying()
            time.sleep(60)
        if self.mode == 'callback' and called() != 1:
            print('crash', flush=True)

    def tick(self):
        self.ticks += 1
        if self.ticks == 1:
            print('ready', flush=True)
        self.done = self.mode in ('aside', 'done') or (
            self.mode == 'goes on' and self.ticks > 3)
        if self.mode == 'exit':
            sys.exit(0)
        if self.mode == 'aside' and self.ticks == 1:
            self.try_aside()
        if self.mode == 'user':
            raise UserError('the disk\nis full')
        if self.mode == 'goes on':
            raise RuntimeError('oops')
        if self.mode == 'busy':
            time.sleep(0.3)

    def try_aside(self):
        print(self.made_in_background(lambda: 'made'))
        for make, patience in ((lambda: 1 / 0, 60.0), (lambda: sys.exit(3), 60.0),
                               (lambda: time.sleep(60), 0.2), (lambda: 1, 0.2)):
            try:
                self.made_in_background(make, patience)
            except BaseException as error:
                print(f'{type(error).__name__}: {error}', flush=True)

    def may_end(self):
        braked, self.braked = self.braked, True
        if self.mode != 'slow' or braked:
            return True
        print('braking', flush=True)
        return False

    def close(self):
        if self.mode == 'slow':
            time.sleep(0.5)
        print('closed', flush=True)


main = partial(run, ExampleNode)

if __name__ == '__main__':
    sys.exit(main(['example', *sys.argv[1:]]))
