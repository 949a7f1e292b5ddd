# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Pictures, drawn from what was recorded alone.

Of an episode: `snapshots` and `squared_error` redraw the paper's two kinds of figure (its Figs. 2
and 3), `timeline`, `hero` and `animation` show a run, `overlay` several in one picture. Of a
campaign: `of_campaign` draws all. Of take-overs: `counterfactual` draws one, `regret` many. Of an
identification: `identification` draws what predictions miss. Of a learner: `learning` draws what
became of its experience; of a model that was learned, `training` draws how good it is.
"""

from dp_swing_ros.figures.campaign import of_campaign
from dp_swing_ros.figures.counterfactual import counterfactual, regret
from dp_swing_ros.figures.curves import ERROR_FLOOR, overlay, squared_error, timeline
from dp_swing_ros.figures.film import animation, hero, snapshots
from dp_swing_ros.figures.identification import identification
from dp_swing_ros.figures.learning import learning, training
from dp_swing_ros.figures.style import mark

__all__ = ['animation', 'counterfactual', 'ERROR_FLOOR', 'hero', 'identification', 'learning',
           'mark', 'of_campaign', 'overlay', 'regret', 'snapshots', 'squared_error', 'timeline',
           'training']
