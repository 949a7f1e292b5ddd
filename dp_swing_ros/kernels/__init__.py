# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How numerical kernels are made: compiled, vectorised, cached."""

from dp_swing_ros.kernels.compilation import kernel, now, processor

__all__ = ['kernel', 'now', 'processor']
