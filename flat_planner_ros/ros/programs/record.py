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

"""Command line of the recorder: what happens on the graph, into an MCAP file."""

from argparse import ArgumentParser
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
import sys

from flat_planner_ros.ros.nodes.node_runner import run
from flat_planner_ros.ros.programs.command_line import explain_missing, parsed, split_arguments


def main(args: Sequence[str] | None = None) -> int:
    """Record until interrupted; return the exit code."""
    own, ros = split_arguments(sys.argv if args is None else args)
    options = parsed(_parser(), own)
    try:
        from flat_planner_ros.ros.recording.recorder_node import RecorderNode
    except ImportError as error:
        return explain_missing(error, 'record')
    path = options.output or Path(f'flat_planner_{datetime.now():%Y-%m-%d_%H-%M-%S}.mcap')
    nodes = []

    def create() -> RecorderNode:
        node = RecorderNode(path, everything=options.all, overwrite=options.force)
        nodes.append(node)
        print(f'recording to {path}, until Ctrl-C', flush=True)
        return node

    code = run([create], ros)
    for node in nodes:
        print(node.summary)
        if node.failure:
            print(node.failure, file=sys.stderr)
            code = 1
    return code


def _parser() -> ArgumentParser:
    """Return the parser of the own arguments."""
    parser = ArgumentParser(
        prog='record',
        usage='%(prog)s [-h] [--output FILE] [--all] [--force] [--ros-args ...]',
        description='Record goals, verdicts, plans, commands, joint states, residuals, reports '
        'and parameters into an MCAP file, which Foxglove, ros2 bag and "analyse" read.',
        epilog='Another namespace: --ros-args -r __ns:=/arm1',
    )
    parser.add_argument(
        '--output',
        '-o',
        metavar='FILE',
        type=Path,
        help='file to write; by default named after the present time, in this directory',
    )
    parser.add_argument('--all', '-a', action='store_true', help='record every topic there is')
    parser.add_argument('--force', action='store_true', help='replace a file that exists')
    return parser


if __name__ == '__main__':
    sys.exit(main())
