# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The logger node: writes topics to a bag that rosbag2 opens."""

import dataclasses
from datetime import datetime
import functools
from pathlib import Path
import time
from typing import Any

from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from dp_swing_ros.bags.metadata import LOST, Recorded
from dp_swing_ros.bags.writer import BagWriter, Storage
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.nodes.connections import described, message_class, request_for
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import declare
from dp_swing_ros.nodes.taking import take
from dp_swing_ros.parameters import named, ParameterError
from dp_swing_ros.parameters.nodes import LoggerParameters
from dp_swing_ros.topics import TOPICS

LOOK_PERIOD = 0.05   # [s] between looks for new publishers
TURN = 0.01          # [s] at most for what waits on one topic, then it is the others' turn
DRAIN_TIME = 0.5     # [s] at most for what waits on a topic that is subscribed to anew
END_TIME = 10.0      # [s] at most for all that waits at the end


@dataclasses.dataclass
class Recording:
    """
    A topic that is being recorded; messages are lost where their numbers have gaps.

    Each publisher counts its messages. Those before the first that came are early ones: sent
    before the subscription and the publisher had found each other, or the logger was started.
    """

    kind: str                    # the type of its messages
    subscription: Subscription
    came: int = 0
    lost: int = 0
    early: int = 0
    last: dict[bytes, int] = dataclasses.field(default_factory=dict)   # number of each publisher

    def count(self, publisher: bytes, number: int) -> None:
        """Count the message of this number."""
        self.came += 1
        if publisher in self.last:
            self.lost += max(number - self.last[publisher] - 1, 0)
        else:
            self.early += number - 1
        self.last[publisher] = number

    def leave(self, limit: float) -> None:
        """Count what still waits as lost, until a time [s]."""
        while time.monotonic() < limit and take(self.subscription):
            self.lost += 1


class LoggerNode(ProcessNode):
    """Subscribes to each topic as its publishers offer it, and writes what comes as it is."""

    linger = 0.3  # [s] others send their last messages at the same signal

    def __init__(self) -> None:
        super().__init__('logger')
        parameters = LoggerParameters(**declare(self, named(LoggerParameters)))
        self._recordings: dict[str, Recording] = {}
        self._impossible = set[str]()   # the names of what cannot be recorded
        self._strange = set[tuple[str, str]]()   # topics, and types that others send there
        folder = Path(parameters.output or f'{datetime.now():dp_swing_%Y_%m_%d-%H_%M_%S}')
        self._names = list(dict.fromkeys(map(self._resolved, parameters.topics)))
        self._bag = BagWriter(folder.expanduser(), Storage(
            parameters.chunk_size, parameters.fsync, parameters.max_bagfile_size,
            round(parameters.max_bagfile_duration * BILLION)))
        self._flush_period = parameters.flush_period
        self._flush_due = time.monotonic()
        self.create_timer(LOOK_PERIOD, self._look)
        self.create_timer(parameters.flush_period, self._flush)
        if parameters.progress_period > 0:
            self.create_timer(parameters.progress_period, self._show_progress)
        self.get_logger().info(f'recording to {self._bag.folder}')

    def close(self) -> None:
        """Finish the bag and print what is in it."""
        try:
            if not self._bag.failed:
                # Under load, what was sent before the end may still wait in the queues.
                limit = time.monotonic() + END_TIME
                while sum(self._take(name, recording, time.monotonic() + TURN)
                          for name, recording in self._recordings.items()):
                    if time.monotonic() > limit:   # by turns, until nothing waits, or for so long
                        for recording in self._recordings.values():
                            recording.leave(limit + DRAIN_TIME)
                        break
        finally:
            self._bag.custom |= {f'{LOST}{name}': str(recording.lost)
                                 for name, recording in self._recordings.items()}
            self._bag.close()
        if self._bag.failed:
            return
        print(f'{self._bag.folder}: {sum(self._bag.counts.values())} messages')
        for name in self._names:
            print(f'  {name}: {self._summary(name)}', flush=True)

    def _summary(self, name: str) -> str:
        if name in self._impossible:
            return 'could not be recorded'
        if name not in self._recordings:
            return '0 written, nobody published it'
        recording = self._recordings[name]
        early = f', {recording.early} sent before they could be heard' if recording.early else ''
        return f'{recording.came} written, {recording.lost} lost{early}'

    def _resolved(self, name: str) -> str:
        try:
            return self.resolve_topic_name(name)
        except RuntimeError as error:
            raise ParameterError(f"parameter 'topics' has {name!r}, which is no topic name: "
                                 f'{error}') from None

    def _look(self) -> None:
        for name in self._names:
            publishers = self.get_publishers_info_by_topic(name)
            if not publishers or name in self._impossible:
                continue
            if name in self._recordings:
                self._meet(name, self._recordings[name], publishers)
            else:
                self._record(name, publishers)

    def _record(self, name: str, publishers: list[TopicEndpointInfo]) -> None:
        # a topic of ours has one type; tools would refuse a bag with another
        kind = next((topic.type for topic in TOPICS if self._resolved(topic.name) == name),
                    publishers[0].topic_type)
        publishers = self._of_kind(name, kind, publishers)
        if not publishers:
            return
        offered = [each.qos_profile for each in publishers]
        try:
            recorded = Recorded(name, kind, schema(kind), str(publishers[0].topic_type_hash),
                                list(map(described, offered)))
            message_class(kind)
        except (AttributeError, BagError, ImportError) as error:
            self.get_logger().error(f'{name} is not recorded: {error}')
            self._impossible.add(name)
            return
        self._bag.add(recorded)
        self._recordings[name] = Recording(kind, self._subscribe(name, kind, request_for(offered)))

    def _of_kind(self, name: str, kind: str,
                 publishers: list[TopicEndpointInfo]) -> list[TopicEndpointInfo]:
        """Return the publishers that send what is recorded; say of others that they do not."""
        for strange in sorted({each.topic_type for each in publishers} - {kind}):
            if (name, strange) not in self._strange:
                self._strange.add((name, strange))
                self.get_logger().warning(
                    f'{name}: {strange} is not recorded; expected {kind}')
        return [each for each in publishers if each.topic_type == kind]

    def _meet(self, name: str, recording: Recording,
              publishers: list[TopicEndpointInfo]) -> None:
        # A subscription never hears a publisher that offers less than it asks for.
        before = recording.subscription.qos_profile
        request = request_for([before, *(each.qos_profile for each in self._of_kind(
            name, recording.kind, publishers))])
        if request == before:
            return
        self._take(name, recording, time.monotonic() + DRAIN_TIME)
        self.destroy_subscription(recording.subscription)
        recording.subscription = self._subscribe(name, recording.kind, request)

    def _subscribe(self, name: str, kind: str, request: QoSProfile) -> Subscription:
        # rclpy's annotations do not know of the information beside a message
        receive: Any = functools.partial(self._receive, name)
        return self.create_subscription(message_class(kind), name, receive, request, raw=True)

    def _receive(self, name: str, data: bytes, info: dict[str, Any]) -> None:
        recording = self._recordings[name]
        self._write(name, recording, data, info)
        # The executor takes one message at a time, which costs it more than we do.
        self._take(name, recording, time.monotonic() + TURN)

    def _take(self, name: str, recording: Recording, limit: float) -> bool:
        """Write what waits on a topic, until a time [s]; return whether there was anything."""
        came = recording.came
        while time.monotonic() < limit and (taken := take(recording.subscription)):
            self._write(name, recording, *taken)
        return recording.came > came

    def _write(self, name: str, recording: Recording, data: bytes, info: dict[str, Any]) -> None:
        number = info['publication_sequence_number']
        self._bag.write(name, data, info['received_timestamp'], info['source_timestamp'], number)
        recording.count(info['publisher_gid'], number)
        if time.monotonic() >= self._flush_due:  # under load the timers may wait for long
            self._flush()

    def _flush(self) -> None:
        self._bag.flush()
        self._flush_due = time.monotonic() + self._flush_period

    def _show_progress(self) -> None:
        recordings = self._recordings.values()
        self.get_logger().info(f'{sum(each.came for each in recordings)} messages written, '
                               f'{sum(each.lost for each in recordings)} lost')


main = functools.partial(run, LoggerNode)
