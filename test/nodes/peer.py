# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node inside the test, to talk to a node under test over DDS."""

import time

from conftest import PATIENCE
from rcl_interfaces.srv import GetParameters
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from dp_swing_ros.nodes.connections import publish, subscribe


class Peer:
    """Records topics, publishes and calls services; spins only while it waits."""

    def __init__(self, name='peer'):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node(name, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def record(self, topic):
        """Return a list that fills with the messages of a topic."""
        messages = []
        subscribe(self.node, topic, messages.append, depth=1000)
        return messages

    def publisher(self, topic):
        """Return a publisher that a subscriber of the topic already hears."""
        publisher = publish(self.node, topic)
        assert self.until(lambda: publisher.get_subscription_count() > 0)
        return publisher

    def until(self, condition, timeout=PATIENCE):
        """Spin until a condition holds; return whether it did."""
        end = time.monotonic() + timeout
        while not condition() and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)
        return bool(condition())

    def spin(self, duration):
        """Spin for a time [s]."""
        self.until(lambda: False, duration)

    def call(self, kind, name, **request):
        """Call a service and return its answer."""
        client = self.node.create_client(kind, name)
        assert self.until(client.service_is_ready)
        answer = client.call_async(kind.Request(**request))
        assert self.until(answer.done)
        self.node.destroy_client(client)
        return answer.result()

    def meet(self, name):
        """Wait until a node hears all publishers of this one, and all subscriptions hear it."""
        # discovery goes in the order in which they were made, and the client is the last
        self.call(GetParameters, f'{name}/get_parameters')

    def reliability(self):
        """Return with which reliability the mpc hears the states, by its subscriptions."""
        return [each.qos_profile.reliability.name for each in
                self.node.get_subscriptions_info_by_topic('/joint_states')
                if each.node_name == 'mpc']

    def close(self):
        """Leave ROS."""
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


class Member(Peer):
    """A peer among a crew, which goes on while it waits."""

    def __init__(self, crew):
        self.executor, self.node = crew.executor, crew.add(Node('peer', context=crew.context))
