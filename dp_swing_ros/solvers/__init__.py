# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Solvers: iLQR, DDP, MPPI and sampled iLQR; the registry that nodes and tools choose from."""

from typing import Any

from dp_swing_ros.parameters import registry
from dp_swing_ros.solvers.descent import DDP, ILQR
from dp_swing_ros.solvers.mppi import MPPI
from dp_swing_ros.solvers.sampled import SampledILQR

# Each is built as a Solver says.
SOLVERS: dict[str, Any] = registry(
    'dp_swing_ros.solvers', ilqr=ILQR, ddp=DDP, mppi=MPPI, sampled_ilqr=SampledILQR)
