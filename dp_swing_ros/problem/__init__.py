# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The optimal control problem: limits, cost, plan, and the regulator at the goal."""
