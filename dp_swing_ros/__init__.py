# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Model predictive control of the double inverted pendulum on a cart."""

import os

# Matrices are small here. Threads of the linear algebra would wait for each other, on a busy
# machine for 20 ms at times; it reads this when NumPy is imported for the first time.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
