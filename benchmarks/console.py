# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the console and a browser take from plant and mpc, and how soon a hand is felt on the page.

Run by `make results`, on a machine that must do nothing else. It takes a picture of the page, too.
"""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from itertools import product
from pathlib import Path
import tempfile
import time
from typing import Any, NamedTuple

from chromium import Page
from live_rates import figures, prioritised, PRIORITY
import numpy as np
import pandas as pd
import psutil
from soak import soak
from stamp import folders, made, sources, store_page, store_table, TOP, verdict

from dp_swing_ros.evaluation.comparison import median
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.play import PAGE, TRIES
from dp_swing_ros.tools.processes import await_ready, Crew, isolated, Process

SOLVER = 'ilqr'
DURATION = 60.0   # [s] of a run
PAIRS = 5         # with and without a page
DRAGS = 40
ASLEEP = 60.0     # [s] that the browser is stopped for
ALLOWED = 0.5     # [ms] that a page may add to the p99 of state to force
SHARE = 20.0      # [%] of a core that the console may take
VISIBLE = 150.0   # [ms] from a drag to its force in the picture
SMOOTH = 60.0     # frames a second
GROWTH = 1.0      # [MB] of the console meanwhile
COUNT = ('window.drawn = 0; const count = () => { window.drawn++; requestAnimationFrame(count); };'
         'count();')


def start_console(crew: Crew, folder: Path) -> tuple[Process, str]:
    """Start a console; return it and the address of its page."""
    console = crew.start('console', {'port': 0, 'recordings': str(folder)}, folder / 'console.log')
    found: list[str] = []

    def missing() -> set[str]:
        found.extend(match[1] for line in console.new_lines() if (match := PAGE.search(line)))
        return set() if found else {'console'}

    await_ready([], missing, time.sleep)
    return console, found[0]


def play(seen: bool, pair: int, priority: int, duration: float, folder: Path) -> dict[str, Any]:
    """
    Run plant and mpc for a time [s], seen by a page or not; return the figures.

    They and the echo have a real-time priority, 0 for none.
    """
    folder.mkdir()
    drawn, browsers, beside = 0.0, list[psutil.Process](), dict[str, int]()
    with ExitStack() as stack:
        if seen:
            console, address = start_console(stack.enter_context(Crew()), folder)
            page = stack.enter_context(Page())
            page.driver.get(address)
            page.driver.execute_script(COUNT)
            browsers = page.processes()
            beside = {'console': console.pid, **{str(each.pid): each.pid for each in browsers}}
        found = soak(folder / 'soak', SOLVER, duration, seed=pair, thread_priority=priority,
                     beside=beside)
        if seen:
            count, passed = page.driver.execute_script(
                'return [window.drawn, performance.now()]')
            drawn = 1e3 * count / passed
    shares = {name: 100 * usage.share for name, usage in found.usage.items()}
    return {'pair': pair, 'page': seen, 'thread_priority': priority, **figures(found),
            'console_share': shares.get('console', 0.0),
            'browser_share': sum(shares[str(each.pid)] for each in browsers), 'frames': drawn}


class Felt(NamedTuple):
    """What was found with hands on the page."""

    drags: list[float]   # [ms] until each was seen
    growth: float        # [MB] of the console while the browser slept
    awake: float         # [s] until it showed the present again


def hands(count: int, asleep: float, folder: Path, picture: Path) -> Felt:
    """Drag the cart so often, let the browser sleep for a time [s], and take a picture."""
    folder.mkdir()
    with Crew() as crew, Page() as page:
        crew.start('mpc', {'shown_tries': TRIES}, folder / 'mpc.log')
        crew.start('plant', {}, folder / 'plant.log')
        console, address = start_console(crew, folder)
        page.open(address)
        time.sleep(8.0)   # it swings up
        for n in range(count):
            page.grip(0, (-1) ** n, 40)
            time.sleep(0.3)
            page.let_go()
            time.sleep(2.0)
        drags = page.drags()
        growth, awake = sleep(page, psutil.Process(console.pid), asleep)
        page.controls()
        page.choose('#mpc-solver-0', 'mppi')
        page.until(lambda: page.text('#now-solver') == 'MPPI', 'MPPI, loaded')
        page.driver.execute_script("document.querySelector('#thoughts-tab').click()")
        before = page.now()
        page.find('#reset').click()
        page.until(lambda: 1.0 < page.now() < before, 'the swing-up')   # the time is the run's
        page.shot(picture)
    return Felt(drags, growth, awake)


def sleep(page: Page, console: psutil.Process, duration: float) -> tuple[float, float]:
    """Stop the browser for a time [s]; return what the console grew [MB], and as `Felt.awake`."""
    then, held = page.now(), console.memory_info().rss
    for process in page.processes():
        process.suspend()
    time.sleep(duration)
    growth = (console.memory_info().rss - held) / 1e6
    for process in page.processes():
        process.resume()
    began = time.monotonic()
    page.until(lambda: page.now() > then + duration - 1.0, 'the present')
    return growth, time.monotonic() - began


def of_latency(priority: int, rows: pd.DataFrame) -> tuple[str, str, bool]:
    """Return aim and figure of the latency that a page adds, and whether it is met."""
    without, seen = (rows[rows.page == each].set_index('pair') for each in (False, True))
    more = median((seen.mpc_p99 - without.mpc_p99).to_numpy())
    of = f'a real-time priority of {priority}' if priority else 'no priority'
    return (f'state to force p99 with a page, less that without (median of {more.runs} pairs of '
            f'{DURATION:g} s), with {of}: at most {ALLOWED:g} ms',
            f'{more.value:+.2f} ms ({more.low:+.2f} to {more.high:+.2f})', more.value <= ALLOWED)


def page_of(rows: pd.DataFrame, felt: Felt, made: str) -> str:
    """Return the page as Markdown."""
    seen, drags = rows[rows.page], median(np.array(felt.drags))
    aims = [
        *(of_latency(priority, of) for priority, of in rows.groupby('thread_priority')),
        (f"the console's share of a core at 20 states and {SMOOTH:g} frames a second: at most "
         f'{SHARE:g} %', f'{seen.console_share.max():.1f} %', seen.console_share.max() < SHARE),
        (f'from a drag to its force in the picture (median of {drags.runs}): below {VISIBLE:g} ms',
         f'{drags.value:.0f} ms ({drags.low:.0f} to {drags.high:.0f})', drags.value < VISIBLE),
        (f'a browser that sleeps for {ASLEEP:g} s: the console grows by less than {GROWTH:g} MB, '
         'and then the page shows the present', f'{felt.growth:+.2f} MB; after '
         f'{felt.awake:.1f} s', felt.growth < GROWTH)]
    return '\n'.join([
        '# What the console costs\n', made,
        'Plant, mpc and a bare echo in real time, with [the console](../console.md) and a page of '
        'it in a browser (chromium without a screen, which draws with the processor) and without, '
        'in turns; without and with [a real-time priority](../nodes.md#time) of plant, mpc and '
        'echo. Shares are hundredths of one core. The rows: '
        '[console.csv.gz](console.csv.gz), [console_drags.csv.gz](console_drags.csv.gz).\n',
        compact([('aim', 'measured', ''), *((aim, found, verdict(is_met))
                                            for aim, found, is_met in aims)]), '',
        compact([('pair', 'page', 'priority', 'state to force p50 [ms]', 'p99', 'echo p99',
                  'late ticks',
                  'mpc [%]', 'plant [%]', 'console [%]', 'browser [%]', 'frames a second'),
                 *((str(row.pair), 'yes' if row.page else 'no',
                    prioritised(row.thread_priority), f'{row.mpc_p50:.2f}',
                    f'{row.mpc_p99:.2f}', f'{row.echo_p99:.2f}', str(row.late_total),
                    f'{row.mpc_share:.0f}', f'{row.plant_share:.0f}',
                    *((f'{row.console_share:.1f}', f'{row.browser_share:.0f}',
                       f'{row.frames:.0f}') if row.page else ('-', '-', '-')))
                   for row in rows.itertuples())]), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Do all runs and drags, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--pairs', type=int, default=PAIRS)
    parser.add_argument('--duration', type=float, default=DURATION, help='of a run [s]')
    parser.add_argument('--drags', type=int, default=DRAGS)
    parser.add_argument('--asleep', type=float, default=ASLEEP, help='[s]')
    parser.add_argument('--docs', type=Path, default=TOP / 'docs')
    arguments = parser.parse_args(argv)
    results, pictures = folders(arguments.docs)
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for pair, priority in product(range(arguments.pairs), (0, PRIORITY)):
            for seen in (False, True)[::(-1) ** pair]:
                print(f'pair {pair}, priority {priority}, with{"" if seen else "out"} a page',
                      flush=True)
                with isolated():
                    rows.append(play(seen, pair, priority, arguments.duration,
                                     Path(folder, f'{pair}_{priority}_{seen}')))
        with isolated():
            felt = hands(arguments.drags, arguments.asleep, Path(folder, 'hands'),
                         pictures / 'console.png')
    store_table(pd.DataFrame({'drag_to_visible': felt.drags}), results / 'console_drags.csv.gz')
    table = pd.DataFrame(rows)
    store_page('console', table, page_of(
        table, felt, made('console', sources('console'))), arguments.docs)


if __name__ == '__main__':
    main()
