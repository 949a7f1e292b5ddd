# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Publish numbered messages at a rate on topics number_0, number_1 and so on, once all are heard.

At the end (a signal, or the duration) it writes when each number went out on which topic: an
array of times [ns] of shape (numbers, topics).
"""

import argparse
from pathlib import Path
import signal
import sys
import time

import numpy as np
import rclpy
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64

# What a logger has not acknowledged yet must not be overwritten by what came after it, even where
# the machine stands still for seconds: that would be this process's loss, not the logger's.
KEPT = QoSProfile(depth=100_000, reliability=ReliabilityPolicy.RELIABLE,
                  durability=DurabilityPolicy.TRANSIENT_LOCAL)
PAUSE = 0.0005  # [s] between looks at the clock
ACKNOWLEDGED = Duration(seconds=0.05)   # until the next look for a signal


def main() -> None:
    """Publish until the end."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('times', type=Path, help='file for the times, .npy')
    parser.add_argument('--rate', type=float, default=20.0, help='messages/s on each topic')
    parser.add_argument('--topics', type=int, default=2)
    parser.add_argument('--duration', type=float, default=float('inf'),
                        help='[s] of messages')
    arguments = parser.parse_args()
    ended: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: ended.append(number))
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('numbered')
    publishers = [node.create_publisher(Float64, f'number_{n}', KEPT)
                  for n in range(arguments.topics)]
    while not ended and not all(each.get_subscription_count() for each in publishers):
        time.sleep(0.01)
    times: list[list[int]] = []
    wanted, start = arguments.duration * arguments.rate, time.monotonic()
    while not ended and len(times) < wanted:
        while not ended and len(times) < min(
                wanted, (time.monotonic() - start) * arguments.rate):
            message, row = Float64(data=float(len(times))), []
            for publisher in publishers:
                row.append(time.time_ns())
                publisher.publish(message)
            times.append(row)
        time.sleep(PAUSE)
    for publisher in publishers:
        # a logger that is ended once the times are there has then received them all
        while not (ended or publisher.wait_for_all_acked(ACKNOWLEDGED)):
            pass
    np.save(arguments.times, np.array(times, dtype=np.int64).reshape(-1, arguments.topics))
    while not ended:  # until then the last messages may be on their way
        time.sleep(0.05)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == '__main__':
    sys.exit(main())
