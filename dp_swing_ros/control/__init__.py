# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The control of a tick: estimator, delay compensation, starts, solver, fallback."""
