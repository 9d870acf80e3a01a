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

"""Everything public of the core is documented: what it is, what it takes, what it holds."""

from dataclasses import fields, is_dataclass
import inspect
import re

from flat_planner_ros import core
import pytest

NAMES = sorted(core.__all__)
CONSTANTS = {name for name in NAMES if isinstance(getattr(core, name), int | float)}
ALIASES = re.compile(r'^(\w+(?:, \w+)*)(?: : .*)?$', re.MULTILINE)


def listed(docstring: str, section: str) -> set[str]:
    """Return the names in a section of a numpydoc docstring."""
    match = re.search(rf'^{section}\n-+\n(.*?)(?=^\w[^\n]*\n-+\n|\Z)', docstring, re.M | re.S)
    if match is None:
        return set()
    return {name for line in ALIASES.findall(match[1]) for name in line.split(', ')}


@pytest.mark.parametrize('name', sorted(set(NAMES) - CONSTANTS))
def test_a_public_name_says_what_it_is(name):
    value = getattr(core, name)
    docstring = inspect.cleandoc(value.__doc__ or '')
    assert docstring
    assert not docstring.startswith(f'{name}('), 'the docstring that a dataclass makes by itself'


@pytest.mark.parametrize('name', sorted(CONSTANTS))
def test_a_constant_is_explained_below_its_value(name):
    homes = [m for _, m in inspect.getmembers(core, inspect.ismodule) if name in vars(m)]
    pattern = rf'^{name}(: [\w.]+)? = .*\n"""'
    assert any(re.search(pattern, inspect.getsource(home), re.M) for home in homes)


@pytest.mark.parametrize(
    'name', [n for n in NAMES if inspect.isclass(getattr(core, n)) and n not in CONSTANTS]
)
def test_what_a_class_holds_and_does_is_documented(name):
    kind = getattr(core, name)
    docstring = inspect.cleandoc(kind.__doc__)
    held = {field.name for field in fields(kind)} if is_dataclass(kind) else set()
    held |= set(getattr(kind, '_fields', ()))
    held = {entry for entry in held if not entry.startswith('_')}
    missing = held - listed(docstring, 'Attributes') - listed(docstring, 'Parameters')
    if len(held) > 2:  # two may be said in the sentence
        assert not missing
    for member, value in vars(kind).items():
        if not member.startswith('_') and callable(getattr(value, 'fget', value)):
            function = getattr(value, 'fget', value)
            if inspect.isfunction(function):
                assert function.__doc__, member


@pytest.mark.parametrize('name', [n for n in NAMES if inspect.isfunction(getattr(core, n))])
def test_what_a_function_takes_is_documented(name):
    function = getattr(core, name)
    taken = set(inspect.signature(function).parameters)
    docstring = inspect.cleandoc(function.__doc__)
    # Up to three may be plain from their names and the sentence, more may be another's.
    if len(taken) > 3 and 'arameters as' not in docstring:
        assert taken <= listed(docstring, 'Parameters')
