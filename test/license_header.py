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
The licence header of every Python file, in the words that ament_copyright knows.

`python test/license_header.py` adds it to files that lack it.
"""

from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
FOLDERS = ('benchmarks', 'docs', 'examples', 'flat_planner_ros', 'launch', 'test')
HEADER = """\
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


def python_files() -> list[Path]:
    """Return all Python files."""
    files = [CHECKOUT / 'setup.py']
    for folder in FOLDERS:
        files += sorted((CHECKOUT / folder).rglob('*.py'))
    return files


def without_header() -> list[Path]:
    """Return the Python files that lack the header."""
    return [path for path in python_files() if not path.read_text('utf-8').startswith(HEADER)]


if __name__ == '__main__':
    for path in without_header():
        path.write_text(f'{HEADER}\n{path.read_text("utf-8")}', 'utf-8')
        print(path.relative_to(CHECKOUT))
