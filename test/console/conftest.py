# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of the console share: nodes in this process."""

from here import start_here  # noqa: F401
