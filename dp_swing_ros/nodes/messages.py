# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States, forces and paths as messages; what reads them needs no ROS: see messages.fields."""

import math
import sys

from builtin_interfaces.msg import Time
import numpy as np
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import Header

from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.parameters import VELOCITY
from dp_swing_ros.pendulum.state import Array, joints, links_of
from dp_swing_ros.pendulum.urdf import ROOT

LAST = 2 ** 31 * BILLION - 1   # [ns]
POINT = ('x', 'y', 'z', 'weight')   # of a cloud


def to_stamp(time: float | int) -> Time:
    """
    Convert a time in seconds (float) or, to the nanosecond, in nanoseconds (int).

    One beyond the last that there is becomes that.
    """
    all_of_it = min(time if isinstance(time, int) else round(time * BILLION), LAST)
    return Time(sec=all_of_it // BILLION, nanosec=all_of_it % BILLION)


def to_joint_state(stamp: Time, x: Array, force: float) -> JointState:
    """
    Convert a state, x (2n + 2,), and the force [N] applied over the period before it.

    Velocities that are not measured, NaN, are left out.
    """
    names = joints(links_of(x))
    position, velocity = x[:len(names)].tolist(), x[len(names):].tolist()
    return JointState(header=Header(stamp=stamp), name=list(names), position=position,
                      velocity=[] if all(map(math.isnan, velocity)) else velocity,
                      effort=[float(force), *[0.0] * (len(names) - 1)])


def to_stamped_command(stamp: Time, cart: str, command: float, drive: str) -> JointState:
    """Convert a command for the cart by its drive, with the stamp of the state that it answers."""
    field = 'velocity' if drive == VELOCITY else 'effort'
    return JointState(header=Header(stamp=stamp), name=[cart], **{field: [command]})


def to_point_cloud(stamp: Time, paths: Array, weights: Array) -> PointCloud2:
    """
    Convert paths in the plane of the pendulum, of which each is a row of points with its weight.

    Shapes: paths (M, T, 2) [m], x and z, weights (M,).
    """
    points = np.zeros((*paths.shape[:2], len(POINT)), np.float32)
    points[..., 0], points[..., 2] = paths[..., 0], paths[..., 1]
    points[..., 3] = np.reshape(weights, (-1, 1))
    height, width, _ = points.shape
    return PointCloud2(
        header=Header(stamp=stamp, frame_id=ROOT), height=height, width=width,
        fields=[PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1)
                for i, name in enumerate(POINT)],
        is_bigendian=sys.byteorder == 'big', is_dense=bool(np.all(np.isfinite(points))),
        point_step=4 * len(POINT), row_step=4 * len(POINT) * width, data=points.tobytes())
