# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Identification: the parameters of pendulum and drive from recorded motion."""
