# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The replay node: plays a bag back onto its topics with its recorded timing."""

from functools import partial
from pathlib import Path
import time

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from dp_swing_ros.bags.mcap_reader import ChannelInfo
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.nodes.connections import (
    Audience, LOOK_PERIOD, message_class, strongest, subscribe)
from dp_swing_ros.nodes.messages import to_stamp
from dp_swing_ros.nodes.playback import excerpt, LATE, Playback, Scheduled
from dp_swing_ros.nodes.process import CLOCK, ProcessNode, run, STEADY
from dp_swing_ros.nodes.ros_parameters import declare
from dp_swing_ros.parameters import named, ParameterError
from dp_swing_ros.parameters.nodes import ReplayParameters
from dp_swing_ros.topics import COMMAND_TOPICS, JOINT_STATES, STAMPED_COMMANDS, Topic

BATCH = 100         # messages at once, so that signals and services are heard in between


class ReplayNode(ProcessNode):
    """Publishes the messages as they are in the bag, each when it is due or, if late, at once."""

    def __init__(self) -> None:
        super().__init__('replay')
        self.parameters = ReplayParameters(**declare(self, named(ReplayParameters)))
        if not self.parameters.bag:
            raise ParameterError("parameter 'bag' is empty; expected the folder of a bag to play: "
                                 '--ros-args -p bag:=my_bag')
        self.outputs: dict[str, Publisher] = {}
        self.clocks: Publisher | None = None
        self.last_forces: dict[str, bytes] = {}  # serialised; of each topic of commands
        self.paused = self.parameters.start_paused
        self.began: float | None = None          # once the subscribers are there

    def prepare(self) -> None:
        """Read the bag and offer what it holds; then look for subscribers."""
        p = self.parameters
        bag = Bag(Path(p.bag).expanduser(), p.partial, topics=list(filter(None, p.topics)) or [''])
        own = {CLOCK} & set(bag.topics) if p.clock > 0 else set[str]()
        messages = excerpt(bag, p, own)
        if own:
            self.get_logger().warning(f'{CLOCK} of the bag is left out: by the parameter clock '
                                      'there is another; expected a clock of 0 to play it')
        span = messages[-1].time - messages[0].time
        if p.loop and span == 0:
            raise BagError(f'{bag} has messages of one moment alone to play; a loop needs two')
        self.playback = Playback(messages, p.rate, p.loop)
        for topic in sorted({message.entry.topic for message in messages}):
            self.outputs[topic] = publish_again(self, topic, bag.channels[topic])
            if any(_is(each, topic, bag.channels[topic])
                   for each in (*COMMAND_TOPICS, *STAMPED_COMMANDS.values())):
                self.last_forces[topic] = b''
        for topic in self.outputs:
            if not _is(JOINT_STATES, topic, bag.channels[topic]):
                continue
            for command in COMMAND_TOPICS:
                name = topic.removesuffix(JOINT_STATES.name) + command.name
                if name not in self.outputs:   # a controller answers those who hear it
                    subscribe(self, command._replace(name=name), lambda message: None)
        self.listen()
        self.get_logger().info(f'{len(messages)} messages over {span / BILLION:.3f} s of {bag}, '
                               f'at rate {p.rate:g}')
        if bag.incomplete:
            self.get_logger().warning(bag.incomplete)

    def listen(self) -> None:
        """Offer the services and the clock, and look for subscribers."""
        self.timer = self.create_timer(1.0, self.on_due, clock=STEADY, autostart=False)
        if self.parameters.clock > 0:
            self.clocks = self.create_publisher(ClockMessage, CLOCK, 10)
            self.every(1 / self.parameters.clock, lambda: self.publish_time(
                self.playback.at(time.monotonic_ns())))
        self.serve('replay/pause', lambda: self.set_paused(True))
        self.serve('replay/resume', lambda: self.set_paused(False))
        self.serve('replay/toggle_paused', lambda: self.set_paused(not self.paused))
        self.serve('replay/is_paused', self.is_paused)
        self.serve('replay/play_next', self.play_next)
        self.audience = Audience(self.outputs.values(), self.parameters.wait)
        self.begin_at: float | None = None
        self.search = self.every(LOOK_PERIOD, self.on_search)

    def on_search(self) -> None:
        """Begin when no more subscribers are found, or after the time that there is for it."""
        now = time.monotonic()
        if self.begin_at is None and self.audience.complete():
            self.begin_at = now + self.parameters.delay
        if self.begin_at is not None and now >= self.begin_at:
            self.destroy_timer(self.search)
            self.began = now
            self.set_paused(self.paused)

    def wait_for_next(self) -> None:
        """Set the timer to when the next message is due, if it ever is."""
        due = self.playback.due()
        if due is None:
            self.timer.cancel()
        else:
            self.timer.timer_period_ns = max(due - time.monotonic_ns(), 1)
            self.timer.reset()

    def on_due(self) -> None:
        """Publish what is due, and wait for the next."""
        for _ in range(BATCH):
            now, due = time.monotonic_ns(), self.playback.due()
            if due is None or due > now:
                break
            self.play(self.playback.take(now))
        self.wait_for_next()

    def play(self, message: Scheduled) -> None:
        """Publish a message, the last of which ends the node; raises BagError if it is damaged."""
        self.publish_time(message.time)
        entry = message.entry
        try:
            data = entry.data
            self.outputs[entry.topic].publish(data)
        except (RuntimeError, ValueError):   # rclpy's RCLError; the middleware takes it apart
            raise BagError(
                f'{self.parameters.bag!r} has a message on {entry.topic}, received at '
                f'{entry.received} ns, that is no {entry.channel.type}; `ros2 run dp_swing_ros '
                'recover` makes a bag without it') from None
        if entry.topic in self.last_forces:
            self.last_forces[entry.topic] = data
        self.done = self.playback.done

    def publish_time(self, now: int) -> None:
        """Publish a time of the bag [ns], if the parameter clock asks for it."""
        if self.clocks is not None:
            self.clocks.publish(ClockMessage(clock=to_stamp(now)))

    def set_paused(self, paused: bool) -> tuple[bool, str]:
        """Let the time of the bag stand still, or go on from where it stands."""
        self.paused = paused
        self.playback.pause(time.monotonic_ns(), paused or self.began is None)
        self.wait_for_next()
        return True, self.is_paused()[1]

    def is_paused(self) -> tuple[bool, str]:
        """Return whether it is paused."""
        return self.paused, 'paused' if self.paused else 'playing'

    def play_next(self) -> tuple[bool, str]:
        """Publish one message while paused; the time of the bag is then that of the message."""
        if not self.paused:
            return False, 'not paused; call replay/pause first'
        message = self.playback.step(time.monotonic_ns())
        self.play(message)
        return True, message.entry.topic

    def close(self) -> None:
        """End a stream of commands with zero, and print what was played."""
        for topic, data in self.last_forces.items():
            output = self.outputs[topic]
            if data and (end := stopped(deserialize_message(data, output.msg_type))) is not None:
                output.publish(end)
        if self.began is None:
            return
        playback, taken = self.playback, time.monotonic() - self.began
        print(f'{self.parameters.bag}: {playback.played.total()} messages in {taken:.3f} s, '
              f'{playback.late} later than {LATE / 1e6:g} ms, '
              f'the latest by {playback.largest_lateness / 1e6:.1f} ms')
        for topic in self.outputs:
            print(f'  {topic}: {playback.played[topic]}', flush=True)


def publish_again(node: Node, name: str, channel: ChannelInfo) -> Publisher:
    """Make a publisher for whoever heard those that a bag recorded; raises BagError."""
    try:
        if channel.encoding != 'cdr':
            raise ValueError(f'it is encoded as {channel.encoding!r}')
        return node.create_publisher(message_class(channel.type), name, strongest(channel.qos))
    except (AttributeError, ImportError, RuntimeError, ValueError) as error:
        # rclpy's RCLError is a RuntimeError: here the topic may have another type
        raise BagError(f'{name} of type {channel.type!r} cannot be published here: {error}; '
                       'name the topics to play, without it') from None


def stopped(command: Float64 | JointState) -> Float64 | JointState | None:
    """Return the command that ends a stream after this one, if it was not zero."""
    if isinstance(command, Float64):
        return Float64(data=0.0) if command.data else None
    if not any((*command.effort, *command.velocity)):
        return None
    return JointState(header=command.header, name=command.name,
                      effort=[0.0] * len(command.effort), velocity=[0.0] * len(command.velocity))


def _is(topic: Topic, name: str, channel: ChannelInfo) -> bool:
    return name.endswith(f'/{topic.name}') and channel.type == topic.type


main = partial(run, ReplayNode)
