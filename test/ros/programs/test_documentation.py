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

"""The interface document tells the truth about names, defaults and codes."""

from pathlib import Path
import re
import subprocess
import sys

from flat_planner_ros import core
from flat_planner_ros.ros.wire import interfaces
import pytest

DOCS = Path(__file__).resolve().parents[3] / 'docs'
CORE = Path(core.__file__).parent
TEXT = (DOCS / 'interfaces.md').read_text('utf-8')
TOPICS = sorted(
    value
    for name, value in vars(interfaces).items()
    if name.isupper() and isinstance(value, str) and value.startswith(('~/', '/'))
)


def test_the_tables_of_parameters_are_those_of_the_code():
    command = [sys.executable, str(DOCS / 'parameter_tables.py'), '--check']
    assert subprocess.run(command, check=False).returncode == 0, 'run docs/parameter_tables.py'


@pytest.mark.parametrize('topic', TOPICS)
def test_a_topic_or_service_is_documented(topic):
    assert f'`{topic}`' in TEXT


@pytest.mark.parametrize('reason', interfaces.ERROR_CODES, ids=lambda reason: reason.name)
def test_an_error_code_is_documented(reason):
    assert f'| {interfaces.ERROR_CODES[reason]} | `{reason.value}` |' in TEXT


def named_in_the_notation() -> list[str]:
    """Return the dotted code names in the tables that begin with a wing or a module."""
    homes = {path.stem for path in CORE.rglob('*.py')} | {path.name for path in CORE.iterdir()}
    lines = (DOCS / 'notation.md').read_text('utf-8').splitlines()
    cells = [line.split(' | ')[1] for line in lines if line.startswith('| ') and ' | ' in line[2:]]
    names = [name for cell in cells for name in re.findall(r'`([\w.]+)[`\[]', cell)]
    return sorted({name for name in names if name.count('.') and name.split('.')[0] in homes})


@pytest.mark.parametrize('name', named_in_the_notation())
def test_a_name_in_the_notation_is_in_the_code(name):
    home, *rest = name.split('.')
    sources = [*CORE.glob(f'{home}/*.py'), *CORE.glob(f'*/{home}.py')]
    text = '\n'.join(path.read_text('utf-8') for path in sources)
    for part in rest:
        assert re.search(rf'\b(def|class) {part}\b|^\s*(self\.)?{part}\b.*[:=]', text, re.M), part


def test_the_derivation_lists_its_sections():
    text = (DOCS / 'derivation.md').read_text('utf-8')
    sections = re.findall(r'^## (\w) (.+)$', text, re.MULTILINE)
    listed = re.findall(r'(\w)\. \[([^\]]+)\]\(#', text.partition('\n## ')[0])
    assert len(sections) > 8
    assert listed == sections


def test_every_page_is_in_the_index():
    pages = {page.stem for page in DOCS.iterdir() if page.suffix in ('.md', '.rst')} - {'index'}
    index = (DOCS / 'index.md').read_text('utf-8')
    assert pages <= set(index.split())
