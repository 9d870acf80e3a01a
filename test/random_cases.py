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

"""How many random cases a test takes: a share in the suite, all of them in `make fuzz`."""

import os

TAKES_ALL = os.environ.get('ALL_CASES') == '1'
"""Set by `make fuzz`."""

SHARE = 5
"""One of so many cases is taken otherwise."""


def cases(number: int, share: int = SHARE) -> int:
    """Return how many of some random cases a test takes now."""
    return number if TAKES_ALL else -(-number // share)
