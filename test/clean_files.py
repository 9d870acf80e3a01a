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
Which files a linter has to look at: those not found clean before, by the same one.

Linters that look at each file by itself find the same again; ruff and mypy remember that
themselves.
"""

from collections.abc import Iterable
from hashlib import sha256
from importlib.metadata import distributions
from pathlib import Path
import sys


class CleanFiles:
    """Files that a linter has found clean, by their names and contents."""

    def __init__(self, folder: Path, linter: str, configuration: str = '') -> None:
        """Read what this linter found, if it and all that is installed were as they are now."""
        installed = sorted(f'{each.name}=={each.version}' for each in distributions())
        by = _digest(sys.version, configuration, *installed)
        self._record = folder / f'{linter}-{by}'
        known = self._record.read_text('utf-8') if self._record.is_file() else ''
        self._clean = set(known.split())

    def others(self, files: Iterable[Path]) -> list[Path]:
        """Return the files that are not known to be clean as they stand."""
        return [path for path in files if _digest_of(path) not in self._clean]

    def remember(self, files: Iterable[Path]) -> None:
        """Take files for clean as they stand, and no others."""
        self._clean = set(map(_digest_of, files))
        self._record.write_text('\n'.join(sorted(self._clean)), 'utf-8')


def _digest_of(path: Path) -> str:
    return _digest(str(path), path.read_text('utf-8'))


def _digest(*texts: str) -> str:
    return sha256('\0'.join(texts).encode()).hexdigest()
