# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of what plant and mpc report, docs/diagnostics.md: `python scripts/diagnostics.py`."""

import dataclasses
from typing import Any

from dp_swing_ros.messages.ticks import TickReport
from dp_swing_ros.runtime.plant import PlantReport
from dp_swing_ros.tables import compact

HEAD = """\
# Diagnostics

Made by `make docs` from the dataclasses that declare them: the values of the statuses of mpc and
plant on `/diagnostics`. The mpc reports each tick, the plant once a second and where it is pushed.
`…` stands for the names that are listed. Bags are read by the same keys, and columns of
[`export`](bags.md) are called so.
"""


def page() -> str:
    """Return the page as Markdown."""
    return f'{HEAD}\n## mpc\n\n{table(TickReport)}\n\n## plant\n\n{table(PlantReport)}'


def table(report: Any) -> str:
    """Return the Markdown table of the values of a report."""
    return compact([('value', 'unit', 'what it says'), *(
        (f'`{about["key"].format("…") or each.name}`', about['unit'], about['words'])
        for each in dataclasses.fields(report) for about in [each.metadata])])


if __name__ == '__main__':
    print(page())
