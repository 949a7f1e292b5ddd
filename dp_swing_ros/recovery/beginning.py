# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What comes before the first damage of a file: all that a killed logger left."""

from contextlib import suppress
from typing import NamedTuple

from dp_swing_ros.bags.mcap_reader import Buffer, Entry, Messages
from dp_swing_ros.recovery.scan import Damage, Reason, Scan


class Beginning(NamedTuple):
    """The messages before the first damage, and what that is."""

    entries: list[Entry]
    damage: str   # in words; empty where all can be read, or nothing says whose a message is
    is_cut: bool  # it is only that the file ends too early


def beginning_of(data: Buffer) -> Beginning:
    """Return the messages of a file up to the first damage."""
    messages = Messages()
    with suppress(ValueError):   # of a channel: the reader has said so already
        for item in Scan(data):
            if isinstance(item, Damage):
                return Beginning(
                    messages.entries, f'after {len(messages.entries)} messages, at byte '
                    f'{item.begin}: {item.reason.value}',
                    item.reason in (Reason.CUT, Reason.NO_END))
            messages.add(item.record)
    return Beginning(messages.entries, '', False)
