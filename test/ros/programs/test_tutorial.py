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

"""The tutorial does what it says: its code, its commands and what they print."""

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
import re
import shlex

from flat_planner_ros.ros.programs import flat_plan, make_urdf
import pytest

CHECKOUT = Path(__file__).resolve().parents[3]
TEXT = (CHECKOUT / 'docs' / 'tutorial.md').read_text('utf-8')
BLOCK = re.compile(r'^```(\w*)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
PROGRAMS = {'flat_plan': flat_plan.main, 'make_urdf': make_urdf.main}


def run_commands(block: str) -> str:
    """Return what the programs of a block print; the last one may refuse, in one line."""
    printed = StringIO()
    for line in block.splitlines():
        program, *arguments = shlex.split(line)
        with redirect_stdout(printed), redirect_stderr(printed):
            PROGRAMS[program](arguments)
    return printed.getvalue()


def run_python(block: str, namespace: dict) -> str:
    """Return what a block prints that goes on where the last one ended."""
    printed = StringIO()
    with redirect_stdout(printed):
        exec(compile(block, 'tutorial.md', 'exec'), namespace)
    return printed.getvalue()


def test_the_tutorial_does_what_it_says(tmp_path, monkeypatch):
    pytest.importorskip('matplotlib')
    monkeypatch.chdir(tmp_path)
    namespace: dict = {}
    kind, printed, checked = '', '', 0
    for language, block in BLOCK.findall(TEXT):
        if language == 'text':
            checked += 1
            if kind == 'python':
                assert printed == block
            # Of a longer summary the tutorial shows the beginnings of some lines.
            for line in block.splitlines():
                assert line in printed
            continue
        kind = language
        if language == 'python':
            printed = run_python(block, namespace)
        elif language == 'sh':
            printed = run_commands(block)
        elif language == 'yaml':
            name = block.partition('\n')[0].removeprefix('# ')
            Path(name).write_text(block, 'utf-8')
    written = {path.name for path in Path().iterdir()}
    assert {'first.csv', 'first.png', 'my_arm.yaml', 'my_arm.png', 'my_arm.urdf'} <= written
    assert checked >= 8


def test_the_core_is_usable_in_five_lines():
    first = next(block for language, block in BLOCK.findall(TEXT) if language == 'python')
    assert len(list(filter(None, first.splitlines()))) <= 5


def test_what_the_tutorial_runs_with_ros_exists():
    setup = (CHECKOUT / 'setup.py').read_text('utf-8')
    for program in re.findall(r'ros2 run flat_planner_ros (\w+)', TEXT):
        assert f"'{program} = " in setup
    for name in re.findall(r'ros2 launch flat_planner_ros ([\w.]+)', TEXT):
        assert (CHECKOUT / 'launch' / name).is_file()


def test_the_python_of_the_readme_prints_what_it_says():
    blocks = BLOCK.findall((CHECKOUT / 'README.md').read_text('utf-8'))
    (python,) = [block for language, block in blocks if language == 'python']
    (text,) = [block for language, block in blocks if language == 'text']
    assert run_python(python, {}) == text
