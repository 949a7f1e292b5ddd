# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pendulum: state, parameters, equations of motion, integrators and their derivatives."""
