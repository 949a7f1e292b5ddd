# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the numbers on a command line may be."""

import argparse
from collections.abc import Callable
import math
from typing import Any

SHOWN = 80  # [characters] of what was given


def within(kind: type, low: float, high: float = math.inf) -> Callable[[str], Any]:
    """Return what reads a finite number between two, both included, and refuses others."""
    def number(text: str) -> Any:
        value = kind(text)
        if not (low <= value <= high and value < math.inf):
            raise argparse.ArgumentTypeError(
                f'{text[:SHOWN]} is not {"a whole number" if kind is int else "a number"} of at '
                f'least {low:g}' + (f' and at most {high:g}' if high < math.inf else ''))
        return value
    return number
