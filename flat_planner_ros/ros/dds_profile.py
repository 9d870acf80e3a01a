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

"""
The settings of the middleware that planned motions want: `config/dds` (docs/two_computers.md).

Fast DDS reads a file of profiles that an environment variable names, when the first node is made.
"""

from collections.abc import Mapping
import os
from pathlib import Path
import sys

FILES = {
    'FASTRTPS_DEFAULT_PROFILES_FILE': 'fastdds.xml',
    'FASTDDS_DEFAULT_PROFILES_FILE': 'fastdds3.xml',
}
"""Environment variables that name the profiles, of Fast DDS 2 and 3, and our file for each."""

OWN_FILES = ('DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml')
"""Files in the present directory that Fast DDS reads by itself."""

NEWER = 'libfastdds.so'
"""Library that Fast DDS 3 has in the place of `libfastrtps.so`."""

PROFILES = Path('config', 'dds')
"""Place of the profiles in the package's share directory, and in the sources."""


def variable() -> str:
    """Return which of them the Fast DDS at hand reads; with both, Kilted ignores its own."""
    libraries = (Path(prefix, 'lib', NEWER) for prefix in (*_prefixes(), sys.prefix))
    return tuple(FILES)[any(library.exists() for library in libraries)]


def profiles() -> dict[str, str]:
    """Return the variable of the Fast DDS at hand with our file; nothing where there is none."""
    package, name = Path(__file__).parents[1], variable()
    shares = [Path(prefix, 'share', package.name) for prefix in _prefixes()]
    files = (place / PROFILES / FILES[name] for place in (package.parent, *shares))
    return next(({name: str(file)} for file in files if file.is_file()), {})


def _prefixes() -> list[str]:
    """Return where packages of ROS are installed."""
    return [*filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))]


def profile_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """
    Return the variables to add for nodes that the package starts itself.

    Parameters
    ----------
    environment
        The variables so far; where they, or a file in the present directory, already configure
        Fast DDS, nothing is added.

    """
    has_own = any(environment.get(name) for name in FILES)
    has_own = has_own or any(Path(name).is_file() for name in OWN_FILES)
    return {} if has_own else profiles()
