# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is left of damaged bags: found, filtered and saved; whole bags are read without it."""
