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

"""Processes that do not outlive the one that started them (Linux)."""

import ctypes

LIBC = ctypes.CDLL(None)
"""Loaded here: between fork and exec nothing may be loaded that other threads load, too."""

PR_SET_PDEATHSIG = 1
"""Option of prctl(2): the signal that a process gets when its parent ends."""


def end_with_parent(number: int) -> None:
    """Have Linux send this process a signal when its parent ends, even if that is killed."""
    LIBC.prctl(PR_SET_PDEATHSIG, number)
