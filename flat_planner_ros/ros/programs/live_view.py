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

"""Live view: the arm, its motions and their residuals in a web browser."""

from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Sequence
from ipaddress import ip_address
import os
import sys

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.ros.live_view.live_node import LiveNode
from flat_planner_ros.ros.nodes.node_runner import run
from flat_planner_ros.ros.programs.command_line import explain_missing, parsed, split_arguments

HOST, PORT = '127.0.0.1', 8765
MAX_PORT = 65535
"""Address of the page by default: for browsers of this machine only."""


class NoAddress(FlatPlannerError):
    """The server cannot have its address; the message says why."""


def main(args: Sequence[str] | None = None) -> int:
    """Serve the page until interrupted; return the exit code."""
    own, ros = split_arguments(sys.argv if args is None else args)
    options = parsed(_parser(), own)
    try:
        from flat_planner_ros.ros.live_view.server import application, ServerThread
    except ImportError as error:
        return explain_missing(error, 'live')
    servers = []

    def create() -> LiveNode:
        node = LiveNode()
        app = application(node.feed, node.obey, options.allow_host)
        try:
            servers.append(ServerThread(app, options.host, options.port))
        except OSError as error:
            node.destroy_node()
            where = f'{options.host}, port {options.port}'
            reason = os.strerror(error.errno) if error.errno and error.errno > 0 else error
            raise NoAddress(f'{where}: {reason}') from error
        _announce(options.host, servers[0].port)
        return node

    try:
        return run([create], ros)
    finally:
        for server in servers:
            server.close()


def _announce(host: str, port: int) -> None:
    """Say where the page is, and who else can reach it."""
    shown = f'[{host}]' if ':' in host else host
    print(f'live view: http://{shown}:{port}/ (until Ctrl-C)', flush=True)
    if host != 'localhost' and not (_is_address(host) and ip_address(host).is_loopback):
        print(
            'anyone who reaches this address can move the arm: there is no password',
            file=sys.stderr,
        )


def _is_address(host: str) -> bool:
    """Return whether a host is given as an address."""
    try:
        ip_address(host)
    except ValueError:
        return False
    return True


def _parser() -> ArgumentParser:
    """Return the parser of the own arguments."""
    parser = ArgumentParser(
        prog='live_view',
        usage='%(prog)s [-h] [--host HOST] [--port PORT] [--allow-host NAME] [--ros-args ...]',
        description='A web page with the arm, its positions, efforts and residuals, the verdicts, '
        'and forms for goals and parameters.',
        epilog='Another namespace: --ros-args -r __ns:=/arm1',
    )
    parser.add_argument(
        '--host', default=HOST, help=f'address to listen at, {HOST} by default; think first'
    )
    parser.add_argument(
        '--port', default=PORT, type=_port, help=f'{PORT} by default; 0 takes any free one'
    )
    parser.add_argument(
        '--allow-host',
        action='append',
        default=[],
        metavar='NAME',
        help='a name of this machine by which browsers may call it, besides addresses',
    )
    return parser


def _port(text: str) -> int:
    """Return a port."""
    if not (text.isdecimal() and int(text) <= MAX_PORT):
        raise ArgumentTypeError(f'{text!r} is no port, 0 to {MAX_PORT}')
    return int(text)


if __name__ == '__main__':
    sys.exit(main())
