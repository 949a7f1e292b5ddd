# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters that a controller runs with, which may change between two ticks."""

from collections.abc import Callable, Mapping
import contextlib
import math
import os
from pathlib import Path
from typing import Any

from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.messages.fields import ERROR, OK, Report, WARN
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.parameters import DRIVEN, FORCE, VELOCITY
from dp_swing_ros.problem.parameters import ADAPTIVE
from dp_swing_ros.runtime.loading import Loader
from dp_swing_ros.runtime.sent import Announcement, Log, PutBack, Sent

SLOWEST = 0.5     # [s] of a tick beyond its time limit; a machine that is busy needs some


class LiveParameters:
    """Loads others beside those in force, takes them over or puts these back, and announces."""

    def __init__(self, values: Mapping[str, Any], send: Callable[[Sent], None], log: Log) -> None:
        """Take all parameters, what sends, and a log; raises ParameterError."""
        check_file(values['learned_file'])
        self.values = dict(values)
        self.send, self.log = send, log
        self.revision = 0                 # how often they have changed
        self.found: dict[str, Any] = {}   # instead of those that were given

    def begin(self, controller: RecedingHorizon) -> None:
        """Take the controller that is made of them, and loaded."""
        self.controller, self.loader = controller, Loader(controller)
        self._look()
        if self.found:
            self.send(Announcement(self.found, self.revision))

    def load(self, controller: RecedingHorizon, values: Mapping[str, Any], waits: bool) -> None:
        """
        Load a controller with other parameters, which count once that is done.

        Where time `waits` it is done at once, however slow its ticks are. Raises ParameterError
        where it cannot be used.
        """
        check_file(values['learned_file'])
        self.loader.load(controller, values, math.inf if waits else SLOWEST)
        if waits:
            self.loader.wait()

    def take_over(self, stamp: int) -> None:
        """Go on with others, if such are ready, or put the last ones back after a stamp [ns]."""
        loaded = self.loader.take()
        if loaded is None:
            return
        if loaded.error:
            text = f'the new parameters cannot be used: {loaded.error}; going on with the last'
            self.log.say(ERROR, text)
            self.send(Report(stamp, ERROR, text, {}, 'parameters'))
            self.send(PutBack(self.values))
            return
        self.controller.reconfigure(loaded.controller)
        self.values = loaded.values
        self.revision += 1
        self._look()
        self.send(Announcement({**self.values, **self.found}, self.revision))

    def find(self, **values: Any) -> None:
        """Announce what was found instead of parameters that were given."""
        self.found |= values
        self.send(Announcement(self.found, self.revision))

    def compare(self, of_plant: Mapping[str, Any]) -> None:
        """Warn of a plant that takes other commands, or less, or has less track, than plans do."""
        drive, of_theirs = self.values['drive'], of_plant.get('drive', FORCE)
        if of_theirs != drive:
            self.log.say(
                ERROR, f'the drive of the plant is {of_theirs!r}, and commands are for {drive!r}: '
                'it hears none of them; give both the same drive', 'drive', math.inf)
        speed = ['cart_speed_limit'] if drive == VELOCITY else []
        for name in ('acceleration_limit' if drive in DRIVEN else 'force_limit', 'track_limit',
                     *speed):
            theirs, own = of_plant.get(name, math.inf), self.values[name]
            if theirs < own:
                self.log.say(
                    WARN, f'{name} is {own:g}, and that of the plant {theirs:g}; expected the '
                    'same for both: it goes with the bodies, unless it is given', name, math.inf)

    def end(self) -> None:
        """Write what was learned beside the equations where `learned_file` says."""
        adaptive, given = self.controller.observer.adaptive, self.values['learned_file']
        if adaptive is None or not given:
            return
        if adaptive.seconds == 0:
            self.log.say(WARN, f'nothing was learned, so {given} is not written')
            return
        file = Path(given).expanduser()
        beside = file.with_name(f'{file.name}.part')   # so that it is never half a file
        try:
            beside.write_text(adaptive.model.to_text(), encoding='utf-8')
            beside.replace(file)
            self.log.say(OK, f'what was learned is in {file}')
        except OSError as error:
            self.log.say(ERROR, f"parameter 'learned_file' is {given!r}: {error.strerror}; "
                         'what was learned is lost, expected a file that may be written')

    def _look(self) -> None:
        """Warn of what is possible, but hardly meant; find a learned model, not just its file."""
        nominal = self.controller.nominal
        if nominal.warning:
            self.log.say(WARN, nominal.warning)
        if self.values['learned_file'] and self.controller.observer.adaptive is None:
            self.log.say(WARN, "parameter 'learned_file' is given, but nothing is learned; "
                         f'expected dynamics {ADAPTIVE}')
        self.found.pop('model', None)
        if nominal.learned is not None:
            self.found['model'] = nominal.learned.to_text()


def check_file(given: str) -> None:
    """Raise ParameterError where what was learned cannot be written into a file that is given."""
    with contextlib.suppress(RuntimeError):   # of the home of nobody
        file = Path(given).expanduser()
        if not given or (not file.is_dir() and file.parent.is_dir()
                         and os.access(file.parent, os.W_OK)):
            return
    raise ParameterError(f"parameter 'learned_file' is {given!r}; expected a file in a folder "
                         'that is there and may be written to')
