# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Takes messages with the GID of who published them, which rclpy leaves out of their information.

Sequence numbers are each publisher's own, so that without it those of several cannot be told
apart. It is at the same place in all of ROS 2 since Iron. For one thread of a process.
"""

import ctypes
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.executors import await_or_execute, SingleThreadedExecutor
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

OK, NOTHING = 0, 401   # RCL_RET_OK, RCL_RET_SUBSCRIPTION_TAKE_FAILED
UNKNOWN = 2 ** 64 - 1  # RMW_MESSAGE_INFO_SEQUENCE_NUMBER_UNSUPPORTED


class _Allocator(ctypes.Structure):
    """rcutils_allocator_t, as a whole."""

    _fields_ = (('functions', ctypes.c_void_p * 4), ('state', ctypes.c_void_p))


class _Bytes(ctypes.Structure):
    """rcutils_uint8_array_t, a serialised message."""

    _fields_ = (('buffer', ctypes.c_void_p), ('length', ctypes.c_size_t),
                ('capacity', ctypes.c_size_t), ('allocator', _Allocator))


class _Info(ctypes.Structure):
    """rmw_message_info_t, with room for more than it holds today."""

    _fields_ = (('source', ctypes.c_int64), ('received', ctypes.c_int64),
                ('number', ctypes.c_uint64), ('reception', ctypes.c_uint64),
                ('middleware', ctypes.c_char_p), ('gid', ctypes.c_uint8 * 16),
                ('room', ctypes.c_uint8 * 256))


_RCL, _RCUTILS = ctypes.CDLL('librcl.so'), ctypes.CDLL('librcutils.so')
_RCL.rcl_take_serialized_message.argtypes = (ctypes.c_void_p,) * 4
_RCUTILS.rcutils_get_default_allocator.restype = _Allocator
_data = _Bytes(None, 0, 0, _RCUTILS.rcutils_get_default_allocator())
_info = _Info()


def take(subscription: Subscription) -> tuple[Any, dict[str, Any]] | None:
    """
    Return the next message of a subscription, and what rclpy says of it with `publisher_gid`.

    What is no message of its type is passed over.
    """
    while (data := _taken(subscription)) is not None:
        try:
            message = data if subscription.raw else deserialize_message(
                data, subscription.msg_type)
        except Exception:
            continue   # anybody may publish any bytes; rmw and rclpy raise errors of their own
        return message, {
            'source_timestamp': _info.source, 'received_timestamp': _info.received,
            'publication_sequence_number': 0 if _info.number == UNKNOWN else _info.number,
            'publisher_gid': bytes(_info.gid)}
    return None


def _taken(subscription: Subscription) -> bytes | None:
    with subscription.handle:
        code = _RCL.rcl_take_serialized_message(
            subscription.handle.pointer, ctypes.byref(_data), ctypes.byref(_info), None)
    if code == OK:
        return ctypes.string_at(_data.buffer, _data.length)
    if code != NOTHING:
        _RCUTILS.rcutils_reset_error()
        raise RuntimeError(f'rcl_take_serialized_message: {code}')
    return None


def arguments(subscription: Subscription) -> tuple[Any, ...] | None:
    """Return what a subscription's callback is to be called with; None without a message."""
    kind = subscription._callback_type
    if kind is kind.WithMessageInfo:
        return take(subscription)
    with subscription.handle:
        taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
    return None if taken is None else taken[:1]


class Executor(SingleThreadedExecutor):
    """An executor whose callbacks are told who published a message."""

    def _take_subscription(self, sub: Subscription) -> Any:
        try:
            found = arguments(sub)
        except InvalidHandle:   # it has been destroyed meanwhile
            return None
        if found is None:
            return None

        async def call() -> None:
            await await_or_execute(sub.callback, *found)
        return call
