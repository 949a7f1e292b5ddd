# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pages of docs/results that seeds decide: their episodes, how these are played and kept."""

from collections.abc import Callable, Sequence
import hashlib
from pathlib import Path
from typing import NamedTuple

import ablation
import campaigns
import compute
import links
import near_goal
import paper_experiments
import rig
import stamp

from dp_swing_ros import provenance
from dp_swing_ros.evaluation.campaign.contestants import Contestant, key
from dp_swing_ros.evaluation.campaign.rows import Row, Table, untimed
from dp_swing_ros.evaluation.campaign.runner import run
from dp_swing_ros.evaluation.scenarios import Case

Episodes = list[tuple[Contestant, Case]]


class Seeded(NamedTuple):
    """
    All episodes of a page, and of which of them one process alone measures the solve times.

    Packages are those whose versions the rows depend on.
    """

    episodes: Callable[[], Episodes]
    timed: Callable[[Case], bool]
    packages: tuple[str, ...] = provenance.COMPUTING


SEEDED = {
    **{name: Seeded(campaign.episodes, campaign.is_timed)
       for name, campaign in campaigns.CAMPAIGNS.items()},
    'near_goal': Seeded(near_goal.episodes, lambda case: False),
    'ablation': Seeded(ablation.episodes, lambda case: False),
    'links': Seeded(links.episodes, links.is_timed),
    'rig': Seeded(rig.episodes, lambda case: False, (*provenance.COMPUTING, 'mujoco')),
    'paper': Seeded(paper_experiments.episodes, lambda case: False),
    'compute': Seeded(compute.episodes, compute.is_timed)}


def sources(page: str) -> str:
    """Return a digest of all that decides the rows of a page: the code and the parameters."""
    text = stamp.sources(page) + repr(SEEDED[page].episodes())
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def played(page: str, folder: Path) -> list[Row]:
    """
    Play the episodes of a page that a folder lacks, and return the rows of all in order.

    Those that are timed come first, one after the other; what the clock decides of others is left
    out. Raises ParameterError and CampaignError.
    """
    episodes, is_timed = SEEDED[page].episodes(), SEEDED[page].timed
    alone = [one for one in episodes if is_timed(one[1])]
    together = [one for one in episodes if not is_timed(one[1])]
    timed, others = Table(folder / 'timed.csv'), Table(folder / 'others.csv')
    run(alone, timed, jobs=1)
    run(together, others, jobs=-1)
    return in_order(episodes, [*timed.rows, *map(untimed, others.rows)])


def in_order(episodes: Episodes, rows: Sequence[Row]) -> list[Row]:
    """Return the rows of all episodes; KeyError where one is missing."""
    found = {row.key: row for row in rows}
    return [found[key(*episode)] for episode in episodes]
