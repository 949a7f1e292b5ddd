# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All that a bag has of a run: its states, what its nodes ran with, how it was recorded."""

from collections import Counter
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

from dp_swing_ros.bags.episodes import configurations_of, episode_of
from dp_swing_ros.bags.metadata import LOST
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError
from dp_swing_ros.evaluation.metrics import measure, Metrics, TIME_LIMIT
from dp_swing_ros.messages.configuration import Configuration, CONTROLLER
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.simulation.episode import Episode
from dp_swing_ros.topics import ROBOT_DESCRIPTION


class Recording(NamedTuple):
    """A run in a bag, with all that is known of it."""

    path: Path
    episode: Episode
    configurations: dict[str, Configuration]  # by node; empty where there are none
    description: str        # the URDF
    began: datetime         # when the first message was received, UTC
    took: float             # [s] until the last was
    counts: dict[str, int]  # messages per topic
    lost: dict[str, int]    # per topic, where the logger counted
    incomplete: str         # how many messages of how many; empty where all are there

    @property
    def metrics(self) -> Metrics:
        """Return the figures of the run, by the time limit of its mpc."""
        mpc = self.configurations.get(CONTROLLER)
        limit = TIME_LIMIT if mpc is None else mpc.parameters.get('time_limit', TIME_LIMIT)
        return measure(self.episode, limit)


def recording(path: Path | str, partial: bool = False,
              namespace: str | None = None, nodes: Sequence[str] = ()) -> Recording:
    """
    Read all that a bag has of its run, given its folder or its MCAP file; see read_episode.

    Raises BagError as `read_episode`, and where metadata.yaml is damaged.
    """
    bag = Bag(path, partial, namespace, nodes)
    episode = episode_of(bag)
    described = bag.any_of(ROBOT_DESCRIPTION)
    received = [entry.received for entry in bag.entries]
    return Recording(
        bag.path, episode, configurations_of(bag),
        described[-1].data if described else urdf(episode.physical, episode.limits),
        datetime.fromtimestamp(min(received) // BILLION, timezone.utc),
        (max(received) - min(received)) / BILLION,
        dict(sorted(Counter(entry.topic for entry in bag.entries).items())), _lost(bag),
        bag.incomplete)


def _lost(bag: Bag) -> dict[str, int]:
    counts = {key.removeprefix(LOST): count for key, count in bag.about.custom.items()
              if key.startswith(LOST)}
    if bag.about.malformed or not all(map(str.isdecimal, counts.values())):
        raise BagError(f'the metadata.yaml of {str(bag.path)!r} is not what rosbag2 writes; '
                       '`ros2 bag reindex` makes it anew')
    return {topic: int(count) for topic, count in counts.items()}


def named(recordings: Sequence[Recording]) -> dict[str, Recording]:
    """
    Return runs by their solvers, and where these are not enough, by their bags too.

    Raises BagError where one bag is given twice.
    """
    solvers = [each.episode.solver or 'no controller' for each in recordings]
    places = [each.path.resolve().parts for each in recordings]
    for place in places:
        if places.count(place) > 1:
            raise BagError(f'the bag {str(Path(*place))!r} is given twice; give each bag once')
    names = [solver if solvers.count(solver) == 1 else f'{solver} {_shortest_end(place, places)}'
             for solver, place in zip(solvers, places)]
    return dict(zip(names, recordings))


def _shortest_end(place: tuple[str, ...], places: Sequence[tuple[str, ...]]) -> str:
    """Return the shortest end of a path that no other has."""
    ends = (place[-length:] for length in range(1, len(place) + 1))
    return '/'.join(next(end for end in ends
                         if sum(other[-len(end):] == end for other in places) == 1))
