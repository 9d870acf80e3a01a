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

"""Everything on the public lists of the core is documented: what it is, takes and holds."""

from dataclasses import fields, is_dataclass
from importlib import import_module
import inspect
from pathlib import Path
import re
from typing import get_origin

from flat_planner_ros import core
import pytest

WINGS = sorted(path.parent.name for path in Path(core.__file__).parent.glob('*/__init__.py'))
LISTED = {
    f'{wing}.{name}': getattr(import_module(f'{core.__name__}.{wing}'), name)
    for wing in WINGS
    for name in import_module(f'{core.__name__}.{wing}').__all__
}
CLASSES = {
    name: value
    for name, value in LISTED.items()
    if inspect.isclass(value) and get_origin(value) is None  # an alias is a class in Python 3.10
}
FUNCTIONS = {name: value for name, value in LISTED.items() if inspect.isfunction(value)}
CONSTANTS = {name for name, value in LISTED.items() if isinstance(value, int | float | str)}
ALIASES = re.compile(r'^(\w+(?:, \w+)*)(?: : .*)?$', re.MULTILINE)
PAGES = Path(__file__).resolve().parents[2] / 'docs' / 'api'


def listed(docstring: str, section: str) -> set[str]:
    """Return the names in a section of a numpydoc docstring."""
    match = re.search(rf'^{section}\n-+\n(.*?)(?=^\w[^\n]*\n-+\n|\Z)', docstring, re.M | re.S)
    if match is None:
        return set()
    return {name for line in ALIASES.findall(match[1]) for name in line.split(', ')}


def test_the_front_door_is_on_the_first_page_by_task():
    shown = re.findall(r'^   (\w+)$', (PAGES / 'index.rst').read_text('utf-8'), re.MULTILINE)
    assert sorted(shown) == sorted([*core.__all__, *WINGS])


@pytest.mark.parametrize('wing', WINGS)
def test_every_wing_has_a_page(wing):
    assert f'.. api-wing:: {wing}\n' in (PAGES / f'{wing}.rst').read_text('utf-8')


@pytest.mark.parametrize('name', core.__all__)
def test_what_is_at_the_front_door_is_on_the_list_of_a_wing(name):
    assert any(getattr(core, name) is value for value in LISTED.values())


@pytest.mark.parametrize('name', sorted(CLASSES | FUNCTIONS))
def test_a_public_name_says_what_it_is(name):
    docstring = inspect.cleandoc(LISTED[name].__doc__ or '')
    assert docstring
    short = name.partition('.')[2]
    assert not docstring.startswith(f'{short}('), 'the docstring that a dataclass makes by itself'


@pytest.mark.parametrize('name', sorted(CONSTANTS))
def test_a_constant_is_explained_below_its_value(name):
    constant = name.partition('.')[2]
    pattern = rf'^{constant}(: [\w.]+)? = [^\n]*\n"""'
    sources = Path(core.__file__).parent.rglob('*.py')
    assert any(re.search(pattern, path.read_text('utf-8'), re.MULTILINE) for path in sources)


@pytest.mark.parametrize('name', sorted(CLASSES))
def test_what_a_class_holds_and_does_is_documented(name):
    kind = CLASSES[name]
    docstring = inspect.cleandoc(kind.__doc__)
    held = {field.name for field in fields(kind)} if is_dataclass(kind) else set()
    held |= set(getattr(kind, '_fields', ()))
    held = {entry for entry in held if not entry.startswith('_')}
    texts = [inspect.cleandoc(base.__doc__ or '') for base in kind.__mro__]
    said = {name for text in texts for name in listed(text, 'Attributes')}
    missing = held - said - listed(docstring, 'Parameters')
    if len(held) > 2:  # two may be said in the sentence
        assert not missing
    for member, value in vars(kind).items():
        if not member.startswith('_') and callable(getattr(value, 'fget', value)):
            function = getattr(value, 'fget', value)
            if inspect.isfunction(function):
                assert function.__doc__, member


@pytest.mark.parametrize('name', sorted(FUNCTIONS))
def test_what_a_function_takes_is_documented(name):
    taken = set(inspect.signature(FUNCTIONS[name]).parameters)
    docstring = inspect.cleandoc(FUNCTIONS[name].__doc__)
    # Up to three may be plain from their names and the sentence, more may be another's.
    if len(taken) > 3 and 'arameters as' not in docstring:
        assert taken <= listed(docstring, 'Parameters')
