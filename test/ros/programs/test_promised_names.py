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

"""What users rely on by name stays within a major version (docs/versions.md)."""

import pytest
from ros.promised_names import present, promised

PRESENT = present()


@pytest.mark.parametrize('kind', promised())
def test_what_has_been_promised_is_there(kind):
    gone = set(promised()[kind]) - set(PRESENT.get(kind, ()))
    assert not gone, f'{kind}: gone or renamed, which needs a new major version (docs/versions.md)'


def test_names_of_every_kind_are_found():
    assert all(PRESENT.values())
    assert set(promised()) == set(PRESENT)
