# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What lies in the folder of a bag: its MCAP files, and what metadata.yaml says of them."""

from collections.abc import Sequence
from pathlib import Path
import re
import shlex
from typing import NamedTuple

from dp_swing_ros.errors import BagError
from dp_swing_ros.parameters.files import parse_file

METADATA = 'metadata.yaml'
RECOVERED = 'recovered_of'  # in custom_data: of how many messages a bag is what was left
UNKNOWN = 'unknown'
NAMED = 10  # files that an error names at most


class Described(NamedTuple):
    """What metadata.yaml says of a bag's folder, or of one of its files."""

    messages: int | None    # None where it does not say
    files: list[str]        # of the folder; none of a file
    custom: dict[str, str]


def described(path: Path) -> Described | None:
    """
    Return what metadata.yaml says of a bag's folder, or of one of its files; None without one.

    Raises ValueError where it is damaged.
    """
    folder = path if path.is_dir() else path.parent
    if not (folder / METADATA).is_file():
        return None
    try:
        about = parse_file(folder / METADATA)['rosbag2_bagfile_information']
        files = {str(each['path']): each for each in about.get('files') or ()}
        names = [str(name) for name in about['relative_file_paths']]
        custom = about.get('custom_data') or {}
        count = (about if path.is_dir() else files.get(path.name, {})).get('message_count')
        return Described(None if count is None else int(count), names if path.is_dir() else [],
                         {str(key): str(value) for key, value in custom.items()})
    except (AttributeError, KeyError, OSError, TypeError, ValueError) as error:
        raise ValueError(f'{str(folder / METADATA)!r} is not what rosbag2 writes') from error


def described_or_none(path: Path) -> Described | None:
    """Return what metadata.yaml says; None also where it is damaged: a bag is read without."""
    try:
        return described(path)
    except ValueError:
        return None


def incomplete(count: int, expected: int | str) -> str:
    """Return what every tool says of a bag that holds so many messages of those recorded."""
    return f'Incomplete: {count} of {expected} messages'


def files_of(path: Path) -> list[Path]:
    """
    Return the MCAP files of a bag, in their order.

    Raises BagError.
    """
    try:
        if path.is_file():
            return [path]
        if not path.exists():
            raise BagError(f'there is no bag {str(path)!r}')
        if not path.is_dir():
            raise BagError(f'cannot read {str(path)!r}: it is neither a folder nor a regular file')
        names = sorted(file.name for file in path.iterdir())
    except OSError as error:
        raise BagError(f'cannot read {str(path)!r}: {error.strerror}') from None
    files = sorted((path / name for name in names if name.endswith('.mcap')), key=_in_order)
    if not files:
        found = ', '.join([*names[:NAMED], *(['...'] if len(names) > NAMED else [])]) or 'nothing'
        raise BagError(f'{str(path)!r} is no bag with an MCAP file, it holds {found}; '
                       f'a bag of another storage: {conversion(path)}')
    return files


def missing_files(about: Described | None, files: Sequence[Path]) -> list[str]:
    """Return the files that metadata.yaml names and that are not there under any name."""
    names, there = about.files if about else [], {file.name for file in files}
    return [name for name in names if name not in there] if len(names) > len(there) else []


def conversion(folder: Path) -> str:
    """Return the commands that make a bag of MCAP of one of another storage."""
    source, target = (shlex.quote(str(folder.resolve()) + end) for end in ('', '_mcap'))
    return (f'`rosbags-convert --src {source} --dst {target} --dst-storage mcap` (pip install '
            f'rosbags) makes one of MCAP, and so does `ros2 bag convert -i {source} -o mcap.yaml` '
            f'with `output_bags: [{{uri: {target}, storage_id: mcap, all_topics: true}}]` in '
            'mcap.yaml')


def _in_order(file: Path) -> list[int | str]:
    # bag_2 before bag_10
    return [int(part) if part.isdecimal() else part for part in re.split(r'(\d+)', file.name)]
