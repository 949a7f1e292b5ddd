# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Campaigns: every contestant through every case, kept in a table, and what the table says.

Contestants and cases make episodes (`episodes`), in parallel (`runner`), each a row of a table on
disk (`rows`) that a stopped campaign goes on from; `summary` counts, `report` writes it down.
"""
