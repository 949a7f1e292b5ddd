# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Plant and mpc in real time for minutes beside a bare echo.

Run by `make results`, on a machine that must do nothing else.
"""

import argparse
from collections.abc import Sequence
import json
import math
from pathlib import Path
import tempfile
from typing import Any

from resources import WARM
from soak import answers, processes, Soak, soak, summary, ticks, times
from soak_figures import draw
from stamp import folders, made, sources, TOP, verdict

from dp_swing_ros.provenance import commit, machine, package_version
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.processes import isolated

SOLVER, DURATION = 'ilqr', 180.0   # [s]
GROWTH = 1.0   # [MB] below which the memory of plant and mpc is to grow


def page(found: Soak, made: str) -> str:
    """Return the page as Markdown."""
    used, by_itself = processes(found), answers(found)['mpc']['late by itself']
    grown = {name: used[name]['growth [MB]'] for name in ('plant', 'mpc')}
    return '\n'.join([
        '# A soak\n', made,
        f'[What it measures](../../benchmarks/soak.py) over {DURATION:g} s. '
        f'`{found.solver}` was {"up to the end" if found.success else "**not held**"}. Late '
        f'answers that the machine did not cause, as the echo tells: {by_itself} (none is the '
        f'aim: {verdict(by_itself == 0)}). Memory, after the first {WARM:g} s: '
        + ', '.join(f'{name} {value:+.2f} MB' for name, value in grown.items())
        + f' (below {GROWTH:g} MB is the aim: {verdict(max(grown.values()) < GROWTH)}).\n',
        '![The soak](../figures/live_soak.png)\n',
        *(f'{table(of)}\n'
          for of in (times(found), answers(found), used, {'ticks': ticks(found)})), ''])


def table(of: dict[str, dict[str, float]]) -> str:
    """Return a table of figures by the name of the row."""
    names = list(next(iter(of.values())))
    return compact([('', *names), *((row, *(f'{values[name]:g}' if isinstance(values[name], int)
                                            else f'{values[name]:.2f}' for name in names))
                                    for row, values in of.items())])


def _plain(value: Any) -> Any:
    """Return what JSON can hold: NaN, which is none of its numbers, becomes null."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    return None if isinstance(value, float) and math.isnan(value) else value


def main(argv: Sequence[str] | None = None) -> None:
    """Soak, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--duration', type=float, default=DURATION, help='[s]')
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    arguments = parser.parse_args(argv)
    results, figures = folders(arguments.docs)
    with tempfile.TemporaryDirectory() as temporary, isolated():
        found = soak(Path(temporary, 'soak'), SOLVER, arguments.duration)
    text = json.dumps(_plain({'version': package_version(), 'commit': commit(),
                              'machine': machine(), **summary(found)}),
                      indent=2, ensure_ascii=False)
    (results / 'live_soak.json').write_text(f'{text}\n', encoding='utf-8')
    draw(found).savefig(figures / 'live_soak.png')
    (results / 'live_soak.md').write_text(
        page(found, made('live_soak', sources('live_soak'))), encoding='utf-8')


if __name__ == '__main__':
    main()
