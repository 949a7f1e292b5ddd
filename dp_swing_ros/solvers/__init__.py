# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Solvers: iLQR, DDP and MPPI; the registry that nodes and tools choose from."""

from typing import Any

from dp_swing_ros.parameters import Registry
from dp_swing_ros.solvers.descent import DDP, ILQR
from dp_swing_ros.solvers.mppi import MPPI

# Each is built as a Solver says.
SOLVERS: Registry[Any] = Registry('dp_swing_ros.solvers', ilqr=ILQR, ddp=DDP, mppi=MPPI)
