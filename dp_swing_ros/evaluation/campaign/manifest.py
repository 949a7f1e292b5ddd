# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a campaign is, kept beside its table: rows of two campaigns must never mix."""

from collections.abc import Iterable
from datetime import datetime
import json
from pathlib import Path
from textwrap import shorten
from typing import Any

from dp_swing_ros.evaluation.campaign.contestants import Contestant
from dp_swing_ros.evaluation.campaign.rows import CampaignError
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.kernels import processor
from dp_swing_ros.provenance import commit, COMPUTING, machine, package_version, packages, sources

# rows depend on these
DECIDES = ('contestants', 'scenarios', 'duration', 'links', 'sources', 'processor')


def describe(contestants: Iterable[Contestant], scenarios: Iterable[str], seeds: range | None,
             levels: int | None, duration: float, links: int) -> dict[str, Any]:
    """Return the description of a campaign, ready for JSON."""
    ranges = {name: seeds or SCENARIOS[name].seeds for name in scenarios}
    return {
        'contestants': {contestant.label: {
            'name': contestant.name, 'plant': contestant.plant, 'mpc': contestant.mpc}
            for contestant in contestants},
        'scenarios': {name: {
            'seeds': [of.start, of.stop],
            'levels': levels or SCENARIOS[name].levels if SCENARIOS[name].sweeps else 0}
            for name, of in ranges.items()},
        'duration': duration, 'links': links, 'sources': sources(), 'processor': processor(),
        'version': package_version(), 'commit': commit()}


def made(command: str) -> dict[str, str]:
    """Return when, where and with what a campaign is made."""
    return {
        'command': command, 'date': f'{datetime.now():%Y-%m-%d %H:%M}', 'machine': machine(),
        'packages': ', '.join(f'{name} {version}' for name, version in packages(
            (*COMPUTING, 'joblib')).items())}


def keep(folder: Path, description: dict[str, Any]) -> None:
    """Write the description into the folder; raises CampaignError where another is there."""
    path = folder / 'campaign.json'
    description = json.loads(json.dumps(description))
    if not path.exists():
        path.write_text(json.dumps(description, indent=1) + '\n', encoding='utf-8')
        return
    before = load(folder)
    for part in DECIDES:
        if before.get(part) != description[part]:
            was, now = (shorten(json.dumps(value, ensure_ascii=False), 200, placeholder='...')
                        for value in (before.get(part), description[part]))
            raise CampaignError(f'{folder} holds a campaign with other {part}: {was}, now {now}; '
                                'give another --output')


def load(folder: Path) -> dict[str, Any]:
    """Read the description of the campaign in a folder; raises CampaignError without one."""
    path = folder / 'campaign.json'
    try:
        description: dict[str, Any] = json.loads(path.read_text(encoding='utf-8'))
        if missing := [part for part in DECIDES if part not in description]:
            raise ValueError(f'its description lacks {", ".join(missing)}')
        return description
    except (OSError, ValueError) as error:
        raise CampaignError(f'{folder} holds no campaign: {error}') from None
