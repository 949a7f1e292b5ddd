# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The messages of one whole MCAP file, by the reader of the mcap library.

What that reader passes over is damage here: a checksum or a count that is wrong, a number that
two channels share, bytes after the end. What is left of a damaged file is for `recovery`.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, suppress
from io import BufferedReader, BytesIO, StringIO
import mmap
import os
from pathlib import Path
import shlex
from types import MappingProxyType
from typing import Any, NamedTuple
import zlib

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, MessageIndex, Schema, Statistics
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
import zstandard

from dp_swing_ros.errors import BagError, one_line

PIECE = 1 << 16    # [bytes] unpacked at a time: what an error costs besides its own block
LARGEST = 1 << 29  # [bytes] of a chunk; writers make them of a few MiB
STREAMS: dict[str, Any] = {'': BytesIO, 'lz4': lambda data: lz4.frame.LZ4FrameFile(BytesIO(data)),
                           'zstd': zstandard.ZstdDecompressor().stream_reader}
HEAD = 22         # [bytes] of a message before its own
DECLARING: dict[int, Any] = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel}
FIELDS = 2000      # lines of a definition: reading one takes the square of their number
DEFINITION = 1 << 18  # [bytes]
COMPRESSED = b'\x28\xb5\x2f\xfd'  # how zstd begins, and CDR cannot
TAKEN = 8         # times its bytes that a message takes once it is decoded
OVERHEAD = 400    # [bytes] of a message beside its own
GIB = 1 << 30


class Mapped(mmap.mmap):
    """A file of which only what is looked at is in memory."""

    file: BufferedReader

    def after_hole(self, place: int) -> int:
        """Return where something of the file is on the disk, from a place on, or the end."""
        try:
            return os.lseek(self.file.fileno(), place, os.SEEK_DATA)
        except OSError:   # nothing more
            return len(self)


Data = bytes | Mapped
Declared = Mapping[tuple[type, int], Any]  # schemas and channels; None where it is not known


class DamagedFile(Exception):
    """A file is not whole; the message says after how many messages, and what is wrong."""


class UnreadableType(ValueError):
    """Messages cannot be read, and not because of what is in them."""


class ChannelInfo:
    """A topic as a channel and its schema describe it."""

    def __init__(self, channel: Channel, schema: Schema | None) -> None:
        self.topic = channel.topic
        self.type = schema.name if schema else ''
        self.encoding = channel.message_encoding
        self.definition = schema.data if schema else b''
        self.metadata = channel.metadata
        self.qos = channel.metadata.get('offered_qos_profiles', '')  # as YAML; may be empty
        self.definition_encoding = schema.encoding if schema else ''
        self.is_ros = (self.encoding, self.definition_encoding) == ('cdr', 'ros2msg')
        self._schema = schema
        self._decoder: Callable[[bytes], Any] | None = None

    @property
    def kind(self) -> tuple[str, str, str, bytes]:
        """Return what the messages are, and how they are written down."""
        return self.type, self.encoding, self.definition_encoding, self.definition

    def decode(self, data: bytes) -> Any:
        """
        Return a message of ROS; raises anything where it is none.

        Raises UnreadableType where the definition is none, as rosbag2 writes those of services
        and actions, or what it says cannot be read.
        """
        # Only who asks for a message minds whether its definition can be read.
        if self._decoder is None:
            self._decoder = self._made_decoder()
        if data[:1] != b'\0':   # the decoder reads whatever comes after four bytes of anything
            raise ValueError('it does not begin as CDR does')
        if data[1:2] > b'\1':
            raise UnreadableType('it is in a representation of CDR that is not the plain one')
        try:
            return self._decoder(_Body(data))
        except NotImplementedError as error:   # a wstring
            raise UnreadableType(str(error)) from None
        except ValueError as error:
            if str(error).startswith('Message definition not found'):
                raise UnreadableType(str(error)) from None
            raise

    def _made_decoder(self) -> Callable[[bytes], Any]:
        if len(self.definition) > DEFINITION or self.definition.count(b'\n') > FIELDS:
            raise UnreadableType(f'its definition is longer than {DEFINITION} bytes or '
                                 f'{FIELDS} lines')
        try:
            with redirect_stderr(StringIO()):   # where its parser prints what is wrong, too
                decoder: Any = DecoderFactory().decoder_for(self.encoding, self._schema)
        except Exception as error:
            raise UnreadableType(one_line(error)) from None
        assert decoder is not None, 'a message of ROS has a decoder'
        return decoder


class _Body(bytes):
    """A message as it is serialised; unlike bytes, it does not end silently."""

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice) and key.stop is not None and key.stop > len(self):
            raise ValueError('it ends amid a field')
        return super().__getitem__(key)


class Entry(NamedTuple):
    """A message, decompressed and decoded if it is asked for."""

    channel: ChannelInfo
    received: int  # [ns]
    sent: int      # [ns]
    sequence: int  # of its publisher
    stored: bytes  # in the file; nothing of a message that nobody asked for
    compressed: bool = False   # as the metadata of its bag say of every message

    @property
    def topic(self) -> str:
        """Return the topic that it is on."""
        return self.channel.topic

    @property
    def data(self) -> bytes:
        """
        Return the message as it was serialised; raises ValueError where it does not decompress.

        A recorder that was killed leaves no metadata, and then its first bytes say it.
        """
        if not self.compressed and not (self.channel.encoding == 'cdr'
                                        and self.stored.startswith(COMPRESSED)):
            return self.stored
        try:
            size = zstandard.frame_content_size(self.stored)
            if not 0 <= size <= LARGEST:
                raise ValueError('it does not say a size that it can have')
            return zstandard.ZstdDecompressor().decompress(self.stored, allow_extra_data=False)
        except (ValueError, zstandard.ZstdError) as error:
            raise ValueError(f'it is compressed, and cannot be read: {one_line(error)}') from None

    @property
    def time(self) -> int:
        """Return when it was sent [ns]; when it was received where a recorder did not know."""
        return self.sent or self.received


class Definitions:
    """The schemas and channels of a file by their numbers: what was declared last of each."""

    def __init__(self, declared: Declared = MappingProxyType({}),
                 compressed: bool = False) -> None:
        self._declared, self._compressed = dict(declared), compressed
        self._channels: dict[int, ChannelInfo] = {}

    def declare(self, item: Schema | Channel) -> bool:
        """Add what a file declares; return whether it agrees with what it declared before."""
        key = type(item), item.id
        before = self._declared.get(key)
        if before != item:
            self._declared[key] = item
            self._channels.clear()
        return before in (None, item)

    def entry(self, message: Message) -> Entry | None:
        """Return a message with its channel; None where that is not known."""
        number = message.channel_id
        if number not in self._channels:
            channel = self._declared.get((Channel, number))
            schema = channel and self._declared.get((Schema, channel.schema_id))
            if channel is None or schema is None and channel.schema_id != 0:
                return None
            self._channels[number] = ChannelInfo(channel, schema)
        return Entry(self._channels[number], message.log_time, message.publish_time,
                     message.sequence, message.data, self._compressed)


class Wanted:
    """What of the messages of a bag is kept, as far as there is memory for it."""

    def __init__(self, ends: tuple[str, ...] = ('',), compressed: bool = False) -> None:
        """Take messages of the topics whose names end so; of others it is known that they came."""
        self.compressed = compressed
        self._ends, self._room = ends, memory_left()  # [bytes]

    def kept(self, entry: Entry) -> Entry:
        """Return a message, without its bytes if nobody wants them; raises MemoryError."""
        if not f'/{entry.topic}'.endswith(self._ends):
            entry = entry._replace(stored=b'')
        self._room -= TAKEN * len(entry.stored) + OVERHEAD
        if self._room < 0:
            raise MemoryError
        return entry


def memory_left() -> int:
    """Return the memory that processes can still take [bytes], as Linux says."""
    with suppress(OSError, ValueError, IndexError):
        for line in Path('/proc/meminfo').read_text().splitlines():
            if line.startswith('MemAvailable:'):
                return 1024 * int(line.split()[1])
    return 1 << 62


class Messages:
    """The messages of a file as they follow each other, each with its channel."""

    def __init__(self, wanted: Wanted) -> None:
        self.entries: list[Entry] = []
        self._wanted = wanted
        self._definitions = Definitions(compressed=wanted.compressed)

    def add(self, record: McapRecord) -> None:
        """Add a message or what declares its channel; raises ValueError where they do not fit."""
        if isinstance(record, (Schema, Channel)):
            if not self._definitions.declare(record):
                raise ValueError(f'has a second {type(record).__name__.lower()} {record.id}')
        elif isinstance(record, Message):
            entry = self._definitions.entry(record)
            if entry is None:
                raise ValueError(f'has a message of the unknown channel {record.channel_id}')
            self.entries.append(self._wanted.kept(entry))


@contextmanager
def contents(file: Path) -> Iterator[Data]:
    """
    Yield the bytes of a file, of which only those that are looked at are in memory.

    Raises BagError, also where what is done with them takes more memory than there is.
    """
    try:
        if not file.is_file() and not file.is_dir():  # to open a pipe would wait for its writer
            raise BagError(f'cannot read {str(file)!r}: it is not a regular file')
        if file.stat().st_size == 0:   # of nothing there is no map
            yield file.read_bytes()
            return
        with file.open('rb') as stream:   # the map outlives it
            data = Mapped(stream.fileno(), 0, access=mmap.ACCESS_READ)
            data.file = stream
            if data[:len(COMPRESSED)] == COMPRESSED:
                raise compressed_file(file)
            yield data
    except OSError as error:
        raise BagError(f'cannot read {str(file)!r}: {error.strerror}') from None
    except MemoryError:
        raise BagError(
            f'{str(file)!r} of {file.stat().st_size / GIB:.2g} GiB holds more than fits into the '
            f'memory, of which {memory_left() / GIB:.2g} GiB are free; give a shorter recording, '
            'or one of fewer topics, as `ros2 bag convert` makes') from None


def compressed_file(file: Path) -> BagError:
    """Return what is wrong with a file that rosbag2 has compressed as a whole."""
    return BagError(f'{str(file)!r} is compressed as a whole (compression_mode FILE); `zstd -d '
                    f'{shlex.quote(str(file))}` makes the file beside it that can be read')


def read(data: Data, wanted: Wanted | None = None) -> list[Entry]:
    """
    Return the messages of a file in their order, or of them what is wanted.

    Raises DamagedFile where it is not whole, MemoryError where there is not enough.
    """
    messages = Messages(wanted or Wanted())
    try:
        _read(data, messages)
    except MemoryError:
        raise
    except Exception as error:  # the library raises whatever damage leads to
        raise DamagedFile(f'after {len(messages.entries)} messages, then '
                          f'{one_line(error)}') from None
    return messages.entries


class _Records(StreamReader):
    """The library's records, without those that it would skip one by one where zeros are left."""

    def _read_record(self, opcode: int, length: int) -> McapRecord | None:
        if opcode == 0:
            raise ValueError('has a record of no kind')
        return super()._read_record(opcode, length)


def _read(data: Data, messages: Messages) -> None:
    counted, indexed = None, 0
    stream: Any = BytesIO(data) if isinstance(data, bytes) else data
    stream.seek(0)
    for record in _Records(stream, emit_chunks=True, validate_crcs=True,
                           record_size_limit=LARGEST).records:
        for item in _unpacked(record) if isinstance(record, Chunk) else (record,):
            messages.add(item)
        if isinstance(record, Statistics):
            counted = record.message_count
        elif isinstance(record, MessageIndex):
            indexed += len(record.records)
    found = len(messages.entries)
    if stream.tell() != len(data):
        raise ValueError('goes on after its end')
    if counted not in (None, found) or indexed > found:  # a record of no kind is passed over
        raise ValueError(f'counts {indexed if counted is None else counted} of them')


def _unpacked(chunk: Chunk) -> Iterator[McapRecord]:
    """Yield what is in a chunk while it is unpacked; raises anything where it is not whole."""
    # of no data at all zstandard would read for ever
    packed = STREAMS[chunk.compression if chunk.data else ''](chunk.data)
    stream, fits = ReadDataStream(packed, calculate_crc=True), True
    while fits and stream.count < chunk.uncompressed_size:
        opcode, length = stream.read1(), stream.read8()
        end = stream.count + length
        fits = opcode != 0 and end <= chunk.uncompressed_size and length <= LARGEST
        if fits and opcode == Opcode.MESSAGE and length >= HEAD:
            yield Message.read(stream, length)
        elif fits and opcode in DECLARING:
            yield DECLARING[opcode].read(stream)
        stream.read(max(end - stream.count, 0) if fits else 0)
        fits = fits and stream.count == end
    if not fits or packed.read(1) or chunk.uncompressed_crc not in (0, stream.checksum()):
        raise ValueError('has a chunk whose checksum or size is wrong')


class Unpacked(NamedTuple):
    """The beginning of a chunk, and how it compares with what the chunk says of itself."""

    content: bytes
    complete: bool  # of the size that it says
    verified: bool  # complete, and with the checksum that it says, if any


def unpack(data: bytes, compression: str, size: int, checksum: int) -> Unpacked:
    """
    Unpack what is to give `size` bytes, up to the first error; a checksum of 0 is none.

    It takes no more memory than these bytes fill.
    """
    content = bytearray()
    # of no data at all zstandard would read for ever
    if data and size <= LARGEST and compression in STREAMS:
        stream = STREAMS[compression](data)
        with suppress(zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
            while len(content) <= size and (piece := stream.read1(PIECE)):
                content += piece
    complete = len(content) == size
    return Unpacked(bytes(memoryview(content)[:size]), complete,
                    complete and (checksum == 0 or zlib.crc32(content) == checksum))
