# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the pages say is what the program does."""

from pathlib import Path
import pkgutil
import re
import runpy

import architecture
from constants import constants_of
from diagnostics import page
import pytest

from dp_swing_ros.tools.parameters import reference

TOP = Path(__file__).parents[1]
PAGES = sorted([*TOP.glob('*.md'), *(TOP / 'docs').rglob('*.md')])


def test_the_reference_of_parameters_is_current():
    assert (TOP / 'docs' / 'parameters.md').read_text() == reference(), 'run `make docs`'


def test_the_list_of_constants_is_current(capsys):
    runpy.run_path(str(TOP / 'scripts' / 'constants.py'), run_name='__main__')
    made = capsys.readouterr().out
    assert (TOP / 'docs' / 'constants.md').read_text() == made, 'run `make docs`'


def test_the_reference_of_diagnostics_is_current():
    assert (TOP / 'docs' / 'diagnostics.md').read_text() == f'{page()}\n', 'run `make docs`'


@pytest.mark.parametrize('comment, verdict', [
    ('# [s] scaled, of a step', 'own units'), ('# [m/s, rad/s] scaled', 'own units'),
    ('# [m/s²] of what has none', 'fixed'), ('# [rad], and [m/s] scaled: slow', 'own units')])
def test_a_constant_with_a_unit_is_listed_with_its_verdict(comment, verdict):
    found, = constants_of(
        f'"""About."""\n\nLONGEST = 0.3   {comment}\nMANY = 3   # turns\n', 'here')
    assert (found.place, found.name, found.value, found.verdict) == (
        'here', 'LONGEST', '0.3', verdict)


def test_the_glossary_calls_things_as_the_code_does():
    text = (TOP / 'docs' / 'glossary.md').read_text()
    sources = '\n'.join(file.read_text() for file in (TOP / 'dp_swing_ros').rglob('*.py'))
    terms = re.findall(r'`([^`]+)`', text)
    for term in terms:
        # /mpc/plan, cost_TERM, mppi.samples, Plan.K, up_up of a goal, backward_time of a phase
        name = re.split(r'[/.]', term.removesuffix(' (2n + 2,)'))[-1]
        name = re.sub(r'_(TERM|time|\*)$|^--|:.*$| \(.*$', '', name)
        assert re.search(rf'\b{re.escape(name)}', sources), term
    assert len(terms) > 60


@pytest.mark.parametrize('page', PAGES, ids=[page.name for page in PAGES])
def test_links_lead_somewhere(page):
    prose = re.sub(r'^```.*?^```', '', page.read_text(), flags=re.M | re.S)
    for target in re.findall(r'\]\(([^)#]+)', prose):
        assert target.startswith('https://') or (page.parent / target).exists(), target


def anchors(page):
    """Return what the headings of a page are called in links."""
    headings = re.findall(r'^#+ (.*)$', page.read_text(), re.M)
    return {re.sub(r'[^\w\- ]', '', each.lower()).replace(' ', '-') for each in headings}


@pytest.mark.parametrize('page', PAGES, ids=[page.name for page in PAGES])
def test_links_into_pages_lead_to_headings(page):
    for target, anchor in re.findall(r'\]\(([^):#]*)#([^)]+)\)', page.read_text()):
        assert anchor in anchors(page.parent / target if target else page), (target, anchor)


@pytest.mark.parametrize('page', PAGES, ids=[page.name for page in PAGES])
def test_links_to_functions_lead_to_the_file_that_defines_them(page):
    """Lines move; a name that is no longer there is found."""
    for names, target in re.findall(r'\[`([\w.]+)`\]\(([^)#]+\.py)\)', page.read_text()):
        source = (page.parent / target).read_text()
        for name in names.split('.'):
            defined = rf'^ *(?:def|class) {name}\b|^(?:\w+, )*{name}\b.* = '
            assert re.search(defined, source, re.M), (names, target)


@pytest.mark.parametrize('page', PAGES, ids=[page.name for page in PAGES])
def test_files_and_tests_that_pages_name_exist(page):
    text = page.read_text()
    for name in re.findall(r'`((?:config|docs|test|dp_swing_ros)/[\w./]+\w)`', text):
        assert (TOP / name).exists(), name
    sources = ''.join(file.read_text() for file in (TOP / 'test').rglob('*.py'))
    for name in re.findall(r'`(test_\w+)`', text):
        assert f'def {name}(' in sources, name


def test_messages_that_troubleshooting_quotes_are_printed():
    sources = ''.join(file.read_text() for file in (TOP / 'dp_swing_ros').rglob('*.py'))
    sources = re.sub(r"""['"]\s*\n\s*f?['"]""", '', sources)    # texts in several parts
    page = (TOP / 'docs' / 'troubleshooting.md').read_text()
    for cell in re.findall(r'^\| (.*?) \|', page, re.M):
        for message in re.findall(r'`([^`]*)`', cell):
            if ' ' in message and not message.startswith('cannot cache function'):   # Numba's
                for part in filter(None, map(str.strip, message.split('…'))):
                    assert part in sources, message


def test_the_layers_and_contracts_of_architecture_are_those_that_are_checked():
    modules = {module.name for module in pkgutil.iter_modules([str(TOP / 'dp_swing_ros')])}
    layers = [name for layer in architecture.contract() for name in layer]
    assert sorted(layers) == sorted(modules - {'__main__'})
    page = (TOP / 'docs' / 'architecture.md').read_text()
    first, *others = re.findall(r"^name = '(.*)'$", (TOP / 'pyproject.toml').read_text(), re.M)
    assert first == 'imports run one way'
    for name in others:
        assert name in page, name
