# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the channels of a file are, and how their messages are decoded."""

from typing import Any, Callable, NamedTuple, TypeVar

from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory

from dp_swing_ros.bags.writer import Recorded
from dp_swing_ros.parameters.plain_yaml import parse, YamlError

D = TypeVar('D', Schema, Channel)
FIELDS = 2000  # lines of a definition: reading one takes the square of their number
DEFINITION = 1 << 18  # [bytes]
PADDING = 12  # [bytes] that a body may have more than its definition asks for


class Line(NamedTuple):
    """A topic as a channel and its schema describe it."""

    topic: str
    type: str        # noqa: A003
    encoding: str    # of its messages
    definition: bytes
    metadata: dict[str, str]
    decode: Callable[[bytes], Any] | None  # None if it is not of ROS 2


class Channels:
    """
    The schemas and channels of a file by their numbers.

    What a number means is what was told last of it. After damage, which may have taken the
    telling, it is what is told anywhere in the file, unless the file tells two things.
    """

    def __init__(self, elsewhere: 'Channels | None' = None) -> None:
        self._latest: dict[tuple[type, int], Any] = {}
        self._told: dict[tuple[type, int, bool], Any] = {}  # None where they are two things
        self._lines: dict[int, Line] = {}
        self._elsewhere = elsewhere

    def tell(self, item: Schema | Channel, verified: bool = True) -> bool:
        """Add what a file says; return whether it agrees with what it said last."""
        key, place = (type(item), item.id), (type(item), item.id, verified)
        agrees = self._latest.get(key, item) == item
        if key not in self._latest or not agrees:
            self._latest[key] = item
            self._lines.clear()
        if self._told.setdefault(place, item) != item:
            self._told[place] = None
        return agrees

    def doubt(self) -> None:
        """Forget what was told last."""
        self._latest.clear()
        self._lines.clear()

    def line(self, number: int) -> Line | None:
        """Return the topic of a channel; None where it is not known."""
        if number not in self._lines:
            channel = self._known(Channel, number)
            if channel is None:
                return None
            schema = self._known(Schema, channel.schema_id)
            if schema is None and channel.schema_id != 0:
                return None
            self._lines[number] = Line(
                channel.topic, schema.name if schema else '', channel.message_encoding,
                schema.data if schema else b'', channel.metadata, _decoder(channel, schema))
        return self._lines[number]

    def _known(self, kind: type[D], number: int) -> D | None:
        if (kind, number) in self._latest or self._elsewhere is None:
            return self._latest.get((kind, number))
        told = self._elsewhere._told
        return told.get((kind, number, (kind, number, True) in told))


class Body(bytes):
    """A message as it is serialised; unlike bytes, it does not end silently."""

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice) and key.stop is not None and key.stop > len(self):
            raise ValueError('it ends amid a field')
        return super().__getitem__(key)


def has_surplus(decode: Callable[[bytes], Any], data: bytes) -> bool:
    """Tell whether a message is longer than its definition asks for, as that of another type."""
    try:
        decode(data[:-PADDING])
    except Exception:  # noqa: B902  as many kinds as there are fields
        return False
    return True


def recorded(line: Line) -> Recorded:
    """Return the topic of a channel as it is written again."""
    try:
        profiles = parse(line.metadata.get('offered_qos_profiles', ''))
    except YamlError:
        profiles = None
    return Recorded(line.topic, line.type, line.definition.decode(),
                    line.metadata.get('topic_type_hash', ''),
                    profiles if isinstance(profiles, list) else [])


def _decoder(channel: Channel, schema: Schema | None) -> Callable[[bytes], Any] | None:
    if schema is None or channel.message_encoding != 'cdr' or schema.encoding != 'ros2msg':
        return None
    prepared: list[Callable[[bytes], Any]] = []

    def decode(data: bytes) -> Any:
        # Only who asks for a message minds whether its definition can be read.
        if not prepared:
            if len(schema.data) > DEFINITION or schema.data.count(b'\n') > FIELDS:
                raise ValueError(f'its definition is longer than {DEFINITION} bytes or '
                                 f'{FIELDS} lines')
            found: Any = DecoderFactory().decoder_for(channel.message_encoding, schema)
            prepared.append(found)
        return prepared[0](Body(data))

    return decode
