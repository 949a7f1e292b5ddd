# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Campaigns: every contestant through every case, kept in a table, and summaries of it.

Contestants play cases (`contestants`), in parallel (`runner`), each episode a row of a table on
disk (`rows`) from which a stopped campaign continues; `summary` counts, `report` writes it down.
"""
