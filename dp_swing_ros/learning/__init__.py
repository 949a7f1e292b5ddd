# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dynamics from experience: what was seen, how a model is fitted to it, and how to explore."""
