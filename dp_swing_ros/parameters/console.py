# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the page of the console is served, to whom, and how it pulls."""

import dataclasses

from dp_swing_ros.parameters import parameter, Parameters

TOKEN_VARIABLE = 'DP_SWING_TOKEN'   # of the environment


@dataclasses.dataclass(frozen=True)
class ConsoleParameters(Parameters):
    """Where the page is served, to whom, and how it pulls."""

    address: str = parameter(
        '127.0.0.1', 'address to serve the page at; any but one of this machine alone asks for a '
        'token', live=False)
    port: int = parameter(8080, 'port to serve the page at (0: any that is free)', minimum=0,
                          maximum=65535, live=False)
    token: str = parameter(
        '', 'what the address must be opened with; empty: that of token_file, of the environment '
        f'variable {TOKEN_VARIABLE}, or else one that is made, where one is needed', secret=True)
    token_file: str = parameter(
        '', 'file with the token, which then stands on no command line', live=False)
    read_only: bool = parameter(False, 'let pages look, and change nothing', live=False)
    recordings: str = parameter(
        'runs', 'folder in which recordings are made, and of which pages may see all', live=False)
    pull_stiffness: float = parameter(
        100.0, 'of the spring by which a page pulls at cart or link', unit='N/m', minimum=0.0,
        scaled=True)
    pull_limit: float = parameter(
        30.0, 'largest force of pulls and pushes, either way', unit='N', minimum=0.0, scaled=True)


SECRETS = {field.name for field in dataclasses.fields(ConsoleParameters)
           if field.metadata['secret']}   # which the announcements of others may hold
