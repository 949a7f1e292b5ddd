# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Model predictive control of the double inverted pendulum on a cart."""
