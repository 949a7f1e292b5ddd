# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Pictures, drawn from what was recorded alone.

Of an episode: `snapshots` and `squared_error` redraw the paper's two kinds of figure (its Figs. 2
and 3).
"""

from dp_swing_ros.figures.cover import hero
from dp_swing_ros.figures.curves import ERROR_FLOOR, squared_error, timeline
from dp_swing_ros.figures.filmstrip import snapshots
from dp_swing_ros.figures.gif import animation
from dp_swing_ros.figures.sampling import states_at

__all__ = ['animation', 'ERROR_FLOOR', 'hero', 'snapshots', 'squared_error', 'states_at',
           'timeline']
