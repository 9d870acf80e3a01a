# Copyright 2026 flat_planner_ros developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What a node is, in a line or two of its log at its start; blocks of files that reach no node."""

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from math import isfinite
from pathlib import Path

from flat_planner_ros.core.arm import Drive, imbalance, InvalidRequest
from flat_planner_ros.core.insensitive import usual_imbalance_residual
from flat_planner_ros.core.planning import JointLimits
from flat_planner_ros.core.session import SessionSettings
from flat_planner_ros.ros.parameters.limits import LIMITS
from flat_planner_ros.ros.parameters.parameter_file import block_names, reaches
from flat_planner_ros.ros.parameters.planner import PlannerSettings
from flat_planner_ros.ros.parameters.row import InvalidParameter
from flat_planner_ros.ros.wire import interfaces
from flat_planner_ros.ros.wire.log_lines import write_line
from rclpy.logging import LoggingSeverity
from rclpy.node import Node

FILE_FLAG = '--params-file'
"""What a parameter file follows on a command line."""

OWN_NODES = (
    interfaces.PLANNER,
    interfaces.PLANT,
    interfaces.MONITOR,
    interfaces.TRACKER,
    interfaces.LIVE_VIEW,
    interfaces.RECORDER,
)
"""Names of the nodes of this package, unless they are given others."""

NEAR = 0.6
"""Likeness of a block's name to a node's from which it is taken for it [-]: planner is."""

UNITS = {'position_min': 'rad', 'position_max': 'rad', 'velocity': 'rad/s', 'effort': 'N m'}
"""Units of limits."""


def introduce(nodes: Sequence[Node], args: Sequence[str]) -> None:
    """
    Let nodes of a process log what they are and where their parameters come from.

    Parameters
    ----------
    nodes
        Those with an attribute `introduction` say it.
    args
        Command line of the process.

    """
    files = parameter_files(args)
    for node in nodes:
        sentence = getattr(node, 'introduction', '')
        if sentence:
            for line in (sentence, sources_sentence(node, files)):
                write_line(node.get_logger(), LoggingSeverity.INFO, line)
    for warning in unused_blocks([node.get_fully_qualified_name() for node in nodes], files):
        write_line(nodes[0].get_logger(), LoggingSeverity.WARN, warning)


def arm_sentence(joints: Sequence[str], drive: Drive) -> str:
    """Return which joints an arm has and what moves it, half a sentence."""
    given = 'an effort' if drive is Drive.EFFORT else 'positions'
    return f'joints {", ".join(joints)} ({joints[-1]} passive), {joints[-2]} is given {given}'


def planner_sentence(node: Node, settings: PlannerSettings) -> str:
    """Return what a planner plans, in brief."""
    session = settings.session
    goal = node.resolve_topic_name(interfaces.GOAL)
    return (
        f'{arm_sentence(session.joints, session.options.drive)}; strategy '
        f'{session.options.strategy.value}; {_limits(session.joints, session.limits)}; goals on '
        f'{goal}{_imbalance(session)}'
    )


def _imbalance(session: SessionSettings) -> str:
    """Return what an arm lacks of balance and what that leaves, a clause; nothing for none."""
    if session.built is None:
        return ''
    share = f"; imbalance {100.0 * imbalance(session.built):.2g} % of the last links' inertia"
    try:
        left, duration = usual_imbalance_residual(
            session.built, session.arm, session.options.drive
        )
    except InvalidRequest:
        return share  # nothing oscillates
    return f'{share}, which leaves about {left:.2g} rad after 90 degrees in {duration:.3g} s'


def _limits(joints: Sequence[str], limits: JointLimits | None) -> str:
    """Return the limits that there are."""
    told = []
    for name in LIMITS if limits is not None else ():
        numbers = zip(joints, getattr(limits, name), strict=True)
        given = [f'{number:g} of {joint}' for joint, number in numbers if isfinite(number)]
        if given:
            told.append(f'{name} {", ".join(given)} {UNITS[name]}')
    return f'limits: {"; ".join(told)}' if told else 'no limits'


def sources_sentence(node: Node, files: Sequence[Path]) -> str:
    """Return from which blocks of which files a node has its parameters."""
    name = node.get_fully_qualified_name()
    told = []
    for path in files:
        used = [block for block in _blocks(path) if reaches(block, name)]
        told.append(f'{path}: {", ".join(used) if used else "no block is for this node"}')
    return f'parameters of {"; ".join(told)}' if told else 'no parameter file'


def unused_blocks(names: Sequence[str], files: Sequence[Path]) -> Iterator[str]:
    """
    Return a warning for each block that was likely meant for a node but reaches none.

    Parameters
    ----------
    names
        Nodes of the process, with their namespaces.
    files
        Parameter files in the order of the command line.

    """
    for path in files:
        blocks = list(_blocks(path))
        for block in blocks:
            wanted = _meant(block, blocks, names)
            if wanted:
                yield (
                    f'{path}: the block {block} reaches no node, its values have no effect; did '
                    f'you mean {wanted}, or /**{wanted[wanted.rindex("/") :]} for any namespace?'
                )


def _meant(block: str, blocks: Sequence[str], names: Sequence[str]) -> str | None:
    """Return the node of this process that a block which reaches none was likely meant for."""
    base = block.rpartition('/')[2]
    by_base = {name.rpartition('/')[2]: name for name in names}
    if base in by_base:
        # A file may have blocks for several arms, each in a namespace.
        name = by_base[base]
        return None if any(reaches(one, name) for one in blocks if base in one) else name
    # It may have blocks for nodes of other processes, too.
    near = get_close_matches(base, [*by_base, *OWN_NODES], n=1, cutoff=NEAR)
    if base in OWN_NODES or not near or any(reaches(block, name) for name in names):
        return None
    return by_base.get(near[0])


def parameter_files(args: Sequence[str]) -> list[Path]:
    """Return the parameter files on a command line."""
    pairs = zip(args, args[1:], strict=False)
    return [Path(value) for flag, value in pairs if flag == FILE_FLAG]


def _blocks(path: Path) -> Sequence[str]:
    """Return the names of a file's blocks; what cannot be read, ROS has refused already."""
    try:
        return block_names(path)
    except InvalidParameter:
        return ()
