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

"""The version of the package, as its metadata have it."""

from argparse import Action, ArgumentParser
from typing import Any

PACKAGE = 'flat_planner_ros'
"""Name of the package."""


def version_line() -> str:
    """Return what a program answers to --version."""
    # Imported here: it takes a tenth of the start of a node, which needs it for --version only.
    from importlib.metadata import PackageNotFoundError, version

    try:
        return f'{PACKAGE} {version(PACKAGE)}'
    except PackageNotFoundError:
        return f'{PACKAGE}, not installed'


class ShowVersion(Action):
    """What --version does: print the line and end."""

    def __init__(self, option_strings: list[str], dest: str, **options: Any) -> None:
        super().__init__(
            option_strings, dest, nargs=0, help="show program's version number and exit"
        )

    def __call__(self, parser: ArgumentParser, *_: Any) -> None:
        """Print and end."""
        print(version_line())
        parser.exit()
