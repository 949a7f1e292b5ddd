# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the pages say is what the program does."""

from pathlib import Path
import re

import pytest

from dp_swing_ros.tools.parameters import reference

TOP = Path(__file__).parents[1]
PAGES = sorted([*TOP.glob('*.md'), *(TOP / 'docs').rglob('*.md')])


def test_the_reference_of_parameters_is_current():
    assert (TOP / 'docs' / 'parameters.md').read_text() == reference(), 'run `make docs`'


@pytest.mark.parametrize('page', PAGES, ids=[page.name for page in PAGES])
def test_links_lead_somewhere(page):
    for target in re.findall(r'\]\(([^)#]+)', page.read_text()):
        assert target.startswith('https://') or (page.parent / target).exists(), target


@pytest.mark.parametrize('page', PAGES, ids=[page.name for page in PAGES])
def test_files_and_tests_that_pages_name_exist(page):
    text = page.read_text()
    for name in re.findall(r'`((?:config|docs|test|dp_swing_ros)/[\w./]+\w)`', text):
        assert (TOP / name).exists(), name
    sources = ''.join(file.read_text() for file in (TOP / 'test').rglob('*.py'))
    for name in re.findall(r'`(test_\w+)`', text):
        assert f'def {name}(' in sources, name
