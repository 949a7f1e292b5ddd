# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The channels of a file, and how their messages are decoded."""

from collections.abc import Mapping
from contextlib import redirect_stderr
from io import StringIO
from types import MappingProxyType
from typing import Any, Callable

from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory

FIELDS = 2000  # lines of a definition: reading one takes the square of their number
DEFINITION = 1 << 18  # [bytes]

Declared = Mapping[tuple[type, int], Any]  # schemas and channels; None where it is not known


class ChannelInfo:
    """A topic as a channel and its schema describe it."""

    def __init__(self, channel: Channel, schema: Schema | None) -> None:
        self.topic = channel.topic
        self.type = schema.name if schema else ''
        self.encoding = channel.message_encoding
        self.definition = schema.data if schema else b''
        self.metadata = channel.metadata
        self.qos = channel.metadata.get('offered_qos_profiles', '')  # as YAML; may be empty
        self.is_ros = schema is not None and (channel.message_encoding, schema.encoding) == (
            'cdr', 'ros2msg')
        self._schema = schema
        self._decoder: Callable[[bytes], Any] | None = None

    def decode(self, data: bytes) -> Any:
        """Return a message of ROS; raises anything where it is none, or the definition none."""
        # Only who asks for a message minds whether its definition can be read.
        if self._decoder is None:
            if len(self.definition) > DEFINITION or self.definition.count(b'\n') > FIELDS:
                raise ValueError(f'its definition is longer than {DEFINITION} bytes or '
                                 f'{FIELDS} lines')
            with redirect_stderr(StringIO()):   # where its parser prints what is wrong, too
                self._decoder = DecoderFactory().decoder_for(self.encoding, self._schema)
            assert self._decoder is not None, 'a message of ROS has a decoder'
        return self._decoder(_Body(data))


class Definitions:
    """The schemas and channels of a file by their numbers: what was declared last of each."""

    def __init__(self, declared: Declared = MappingProxyType({})) -> None:
        self._declared = dict(declared)
        self._channels: dict[int, ChannelInfo] = {}

    def declare(self, item: Schema | Channel) -> bool:
        """Add what a file declares; return whether it agrees with what it declared before."""
        key = type(item), item.id
        before = self._declared.get(key)
        if before != item:
            self._declared[key] = item
            self._channels.clear()
        return before in (None, item)

    def channel(self, number: int) -> ChannelInfo | None:
        """Return a channel; None where it is not known."""
        if number not in self._channels:
            channel = self._declared.get((Channel, number))
            schema = channel and self._declared.get((Schema, channel.schema_id))
            if channel is None or schema is None and channel.schema_id != 0:
                return None
            self._channels[number] = ChannelInfo(channel, schema)
        return self._channels[number]


class _Body(bytes):
    """A message as it is serialised; unlike bytes, it does not end silently."""

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice) and key.stop is not None and key.stop > len(self):
            raise ValueError('it ends amid a field')
        return super().__getitem__(key)
