# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import json

import pytest

from dp_swing_ros.evaluation.campaign import manifest
from dp_swing_ros.evaluation.campaign.contestants import parse_all
from dp_swing_ros.evaluation.campaign.rows import CampaignError


def described(*contestants, scenarios=('hanging',), seeds=range(3), levels=None, duration=4.0,
              links=2):
    return manifest.describe(parse_all(contestants or ['ilqr']), scenarios, seeds, levels,
                             duration, links)


def test_the_same_campaign_may_go_on(tmp_path):
    manifest.keep(tmp_path, described('mppi:horizon=20+force_limit=.inf', 'nothing'))
    manifest.keep(tmp_path, described('mppi:horizon=20+force_limit=.inf', 'nothing'))
    assert list(manifest.load(tmp_path)['contestants']) == [
        'mppi:horizon=20+force_limit=.inf', 'nothing']


@pytest.mark.parametrize('other, part', [
    (lambda: described('ddp'), 'contestants'), (lambda: described('ilqr:horizon=20'), 'horizon'),
    (lambda: described(seeds=range(4)), 'scenarios'),
    (lambda: described(scenarios=('hanging', 'delay')), 'delay'),
    (lambda: described(duration=5.0), 'duration'), (lambda: described(links=3), 'links'),
    (lambda: {**described(), 'sources': 'others'}, 'sources')])
def test_another_campaign_is_refused(other, part, tmp_path):
    manifest.keep(tmp_path, described())
    before = (tmp_path / 'campaign.json').read_text()
    with pytest.raises(CampaignError, match='give another --output') as error:
        manifest.keep(tmp_path, other())
    assert part in str(error.value)
    assert (tmp_path / 'campaign.json').read_text() == before


def test_what_a_campaign_was_made_with_may_differ(tmp_path):
    manifest.keep(tmp_path, {**described(), 'commit': 'a', 'made': manifest.made('evaluate')})
    manifest.keep(tmp_path, {**described(), 'commit': 'b'})
    assert manifest.load(tmp_path)['commit'] == 'a'
    assert 'numba' in manifest.load(tmp_path)['made']['packages']


def test_scenarios_have_their_seeds_and_levels():
    scenarios = described(scenarios=('random', 'delay'), seeds=None)['scenarios']
    assert scenarios == {'random': {'seeds': [0, 1000], 'levels': 0},
                         'delay': {'seeds': [0, 1], 'levels': 21}}


@pytest.mark.parametrize('content', [None, '{"contestants": ', '{"duration": 10.0}'])
def test_a_folder_without_a_campaign_is_refused(content, tmp_path):
    if content is not None:
        (tmp_path / 'campaign.json').write_text(content)
    with pytest.raises(CampaignError, match='no campaign'):
        manifest.load(tmp_path)


def test_a_description_is_json():
    json.dumps(described('tvlqr', 'mppi:force_limit=.inf'))
