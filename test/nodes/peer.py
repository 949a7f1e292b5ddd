# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node inside the test, to talk to a node under test over DDS."""

from conftest import PATIENCE, spin_until
from rcl_interfaces.srv import GetParameters
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from dp_swing_ros.nodes.connections import publish, subscribe

AGAIN = 10.0    # [s] after which what was asked is asked again


class Peer:
    """Records topics, publishes and calls services; spins only while it waits."""

    def __init__(self, name='peer'):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node(name, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.clients = {}   # by the names of their services

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
        return spin_until(self.executor, condition, timeout)

    def spin(self, duration):
        """Spin for a time [s]."""
        self.until(lambda: False, duration)

    def call(self, kind, name, **request):
        """Call a service and return its answer."""
        if name not in self.clients:
            self.clients[name] = self.node.create_client(kind, name)
            self.meet(name.rpartition('/')[0])   # an answer to a client not found yet is lost
        client = self.clients[name]
        assert self.until(client.service_is_ready)
        answer = client.call_async(kind.Request(**request))
        assert self.until(answer.done)
        return answer.result()

    def meet(self, name):
        """Wait until a node hears all publishers of this one, and all subscriptions hear it."""
        # discovery goes in the order in which they were made, and the client is the last
        client, answers = self.node.create_client(GetParameters, f'{name}/get_parameters'), []
        assert self.until(client.service_is_ready)

        def is_answered():
            answers.append(client.call_async(GetParameters.Request()))
            return self.until(lambda: any(answer.done() for answer in answers), AGAIN)
        assert any(is_answered() for _ in range(round(PATIENCE / AGAIN)))
        self.node.destroy_client(client)

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
        self.clients = {}
