# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of pages that seeds decide: their episodes, how these are played and kept."""

from collections.abc import Callable, Sequence
import hashlib
from pathlib import Path
from typing import NamedTuple

import ablation
import campaigns
import drives
import links
import numpy as np
import paper_experiments
import rig
import sizes
import stamp

from dp_swing_ros import provenance
from dp_swing_ros.evaluation.campaign.contestants import Contestant, key
from dp_swing_ros.evaluation.campaign.rows import Key, Row, store, Table, untimed
from dp_swing_ros.evaluation.campaign.runner import run
from dp_swing_ros.evaluation.scenarios import Case

Episodes = list[tuple[Contestant, Case]]


class Seeded(NamedTuple):
    """
    All episodes of a part, and of which of them one process alone measures the solve times.

    Packages are those whose versions the rows depend on.
    """

    episodes: Callable[[], Episodes]
    timed: Callable[[Case], bool]
    packages: tuple[str, ...] = provenance.COMPUTING


SEEDED = {
    **{name: Seeded(campaign.episodes, campaign.is_timed)
       for name, campaign in campaigns.CAMPAIGNS.items()},
    'ablation': Seeded(ablation.episodes, lambda case: False),
    'links': Seeded(links.episodes, links.is_timed),
    'drives': Seeded(drives.episodes, lambda case: False,
                     (*provenance.COMPUTING, 'mujoco')),
    'sizes': Seeded(sizes.episodes, lambda case: False),
    'rig': Seeded(rig.episodes, lambda case: False, (*provenance.COMPUTING, 'mujoco')),
    'paper': Seeded(paper_experiments.episodes, lambda case: False)}
# whatever the rounding, the solvers with their defaults hold these, and settle when they do; from
# near the goal, some 17 degrees off, it may decide whether the links turn over once more
SETTLES = {'hanging', 'swing-up'}
HOLDS = {*SETTLES, 'near_goal', 'near the goal', 'random'}
DEFAULTS = {f'{name}{setup}' for name in campaigns.METHODS for setup in (
    '', ', defaults', f', without {ablation.DEFAULTS}', ', one link, 20 N')}
SAMPLE = 3   # rows of each kind that stay in the repository


def sources(part: str) -> str:
    """Return a digest of all that decides the rows of a part: the code and the parameters."""
    text = stamp.sources(part) + repr(SEEDED[part].episodes())
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def played(part: str, folder: Path) -> list[Row]:
    """
    Play the episodes of a part that a folder lacks, and return the rows of all in order.

    Those that are timed come first, one after the other; what the clock decides of others is left
    out. Raises ParameterError and CampaignError.
    """
    episodes, is_timed = SEEDED[part].episodes(), SEEDED[part].timed
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


def is_sure(one: Key) -> bool:
    """Return whether another rounding cannot change how an episode ends."""
    return one.scenario in HOLDS and one.contestant in DEFAULTS


def sample(rows: Sequence[Row]) -> list[Row]:
    """Return a few rows of as many contestants as possible, first some that are sure."""
    order = [rows[n] for n in np.random.default_rng(11).permutation(len(rows))]
    chosen: dict[str, Row] = {}
    for row in order:
        if is_sure(row.key):
            chosen.setdefault(row.key.contestant, row)
    chosen = dict(list(chosen.items())[:SAMPLE])
    for row in order:
        if len(chosen) < 2 * SAMPLE:
            chosen.setdefault(row.key.contestant, row)
    return list(chosen.values())


def store_sample(part: str, rows: Sequence[Row], folder: Path) -> None:
    """Store a few rows of a part, for a test that plays them again."""
    folder.mkdir(parents=True, exist_ok=True)
    store(folder / f'{part}.csv.gz', [untimed(row) for row in sample(rows)])
