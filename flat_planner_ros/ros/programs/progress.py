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

"""How far a program has come, on a terminal with tqdm; silent without either."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import sys

BAR = '{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}'
"""What is shown: shares of files are no numbers that mean anything to anybody."""


@contextmanager
def progress(total: float, name: str) -> Iterator[Callable[[float], object]]:
    """
    Show how far work has come, while it goes on, on standard error if that is a terminal.

    Parameters
    ----------
    total
        All that is to be done.
    name
        Of the program.

    Yields
    ------
    callable
        Is told how much has been done since it was last told.

    """
    bar = None
    if sys.stderr.isatty():
        try:
            # Imported here: tqdm is an extra.
            from tqdm import tqdm
        except ImportError:
            pass
        else:
            bar = tqdm(total=total, desc=name, bar_format=BAR, leave=False, file=sys.stderr)
    try:
        yield float if bar is None else bar.update
    finally:
        if bar is not None:
            bar.close()
