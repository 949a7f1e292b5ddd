# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A campaign against a stored one, episode by episode: what each held, settling, equal rows."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from dp_swing_ros.evaluation.campaign.report import difference, probability, ratio
from dp_swing_ros.evaluation.campaign.rows import CampaignError, identical, Key, Row
from dp_swing_ros.evaluation.campaign.summary import Duel, duel
from dp_swing_ros.tables import compact

ABOUT = """\
Pairs are the episodes of the same contestant, scenario, level and seed; identical are those whose
rows are equal to the bit, the clock apart. What only one of the two held comes with the p of
McNemar's exact test; where both held, the median difference of the settling times (now less
stored) with its 95 % interval (bootstrap) and the p of the sign test, and the ratio of the
closed-loop costs (now over stored, geometric mean) with its 95 % interval (bootstrap)."""


class Rivals(NamedTuple):
    """A contestant in a scenario, now (first) and as stored, over the episodes that both have."""

    duel: Duel
    identical: int


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
    return [Rivals(duel(scenario, contestant, 'stored', pairs),
                   sum(identical(*pair) for pair in pairs))
            for (contestant, scenario), pairs in groups.items()]


def refuse_strangers(keys: Iterable[Key], stored: Sequence[Row]) -> None:
    """Raise CampaignError where none of these episodes is stored."""
    if not {row.key for row in stored} & set(keys):
        names = dict.fromkeys(f'{row.key.contestant} in {row.key.scenario}' for row in stored)
        raise CampaignError('no episode of this campaign is stored; stored are '
                            f'{", ".join(names) or "none"}')


def compared(place: str, found: Sequence[Rivals]) -> str:
    """Return the comparison with what is stored in a place, as Markdown."""
    lines = compact([
        ('scenario', 'contestant', 'pairs', 'identical', 'held only now', 'held only as stored',
         'p', 'settling [s]', 'Σℓ, ratio'),
        *((one.scenario, f'`{one.first}`', str(one.cases), str(same), str(one.first_only),
           str(one.second_only), probability(one.p), difference(one.differences['settling_time']),
           ratio(one.cost)) for one, same in found)])
    return f'## Against {place}\n\n{ABOUT}\n\n{lines}\n'
