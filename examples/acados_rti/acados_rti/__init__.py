# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""SQP by acados, an iteration a tick: the problem in CasADi, its C code, and the solver."""
