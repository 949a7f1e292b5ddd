# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A campaign against a stored one, episode by episode: what each held, settling, equal rows."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from dp_swing_ros.evaluation.campaign.report import difference, probability, ratio, table
from dp_swing_ros.evaluation.campaign.rows import CampaignError, identical, Key, Row
from dp_swing_ros.evaluation.comparison import Paired, paired, paired_ratio, Ratio, sign_test

ABOUT = """\
Pairs are the episodes of the same contestant, scenario, level and seed; identical are those whose
rows are equal to the bit, the clock apart. What only one of the two held comes with the p of
McNemar's exact test; where both held, the median difference of the settling times (now less
stored) with its 95 % interval (bootstrap) and the p of the sign test, and the ratio of the
closed-loop costs (now over stored, geometric mean) with its 95 % interval (bootstrap)."""


class Rivals(NamedTuple):
    """A contestant in a scenario, now and as stored, over the episodes that both have."""

    contestant: str
    scenario: str
    pairs: int
    identical: int
    only_now: int       # held
    only_stored: int
    p: float
    settling: Paired    # [s] now less stored
    cost: Ratio         # now over stored


def rivals(now: Sequence[Row], stored: Sequence[Row]) -> list[Rivals]:
    """
    Pair the rows of two campaigns, in the order of the first.

    Raises CampaignError where they have no episode in common.
    """
    refuse_strangers([row.key for row in now], stored)
    before = {row.key: row for row in stored}
    groups: dict[tuple[str, str], list[tuple[Row, Row]]] = {}
    for row in now:
        if row.key in before:
            groups.setdefault(row.key[:2], []).append((row, before[row.key]))
    return [rival(*names, pairs) for names, pairs in groups.items()]


def refuse_strangers(keys: Iterable[Key], stored: Sequence[Row]) -> None:
    """Raise CampaignError where none of these episodes is stored."""
    if not {row.key for row in stored} & set(keys):
        names = dict.fromkeys(f'{row.key.contestant} in {row.key.scenario}' for row in stored)
        raise CampaignError('no episode of this campaign is stored; stored are '
                            f'{", ".join(names) or "none"}')


def rival(contestant: str, scenario: str, pairs: Sequence[tuple[Row, Row]]) -> Rivals:
    """Compare the episodes of a contestant in a scenario, each now and as stored."""
    won = sum(now.metrics.success and not then.metrics.success for now, then in pairs)
    lost = sum(then.metrics.success and not now.metrics.success for now, then in pairs)
    both = [(now.metrics, then.metrics) for now, then in pairs
            if now.metrics.success and then.metrics.success]
    settling = np.array([[each.settling_time for each in pair] for pair in both]).reshape(-1, 2)
    cost = np.array([[each.closed_loop_cost for each in pair] for pair in both]).reshape(-1, 2)
    return Rivals(contestant, scenario, len(pairs), sum(identical(*pair) for pair in pairs),
                  won, lost, sign_test(won, lost), paired(*settling.T), paired_ratio(*cost.T))


def compared(place: str, found: Sequence[Rivals]) -> str:
    """Return the comparison with what is stored in a place, as Markdown."""
    return '\n'.join([f'## Against {place}', '', ABOUT, '', *_lines(found)]) + '\n'


def _lines(found: Sequence[Rivals]) -> Iterator[str]:
    yield from table([
        ('scenario', 'contestant', 'pairs', 'identical', 'held only now', 'held only as stored',
         'p', 'settling [s]', 'Σℓ, ratio'),
        *((one.scenario, f'`{one.contestant}`', str(one.pairs), str(one.identical),
           str(one.only_now), str(one.only_stored), probability(one.p),
           difference(one.settling), ratio(one.cost)) for one in found)])
