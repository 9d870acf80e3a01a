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

"""Directive `api-reference`: the public list of the core, module by module."""

from importlib import import_module
import inspect

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import nested_parse_with_titles

CORE = 'flat_planner_ros.core'


def modules() -> dict[str, list[str]]:
    """Return the public names of the core by the modules that define them."""
    core = import_module(CORE)
    found: dict[str, list[str]] = {}
    for name in core.__all__:
        value = getattr(core, name)
        is_defined = inspect.isclass(value) or inspect.isfunction(value)
        home = value.__module__ if is_defined else _home_of_constant(name)
        found.setdefault(home, []).append(name)
    return dict(sorted(found.items()))


def _home_of_constant(name: str) -> str:
    """Return the module that assigns a constant."""
    core = import_module(CORE)
    for home, module in inspect.getmembers(core, inspect.ismodule):
        if name in vars(module) and f'{name} =' in inspect.getsource(module):
            return f'{CORE}.{home}'
    return CORE


class ApiReference(SphinxDirective):
    """One section for each module: what it says of itself, then its public names."""

    def run(self) -> list[nodes.Node]:
        """Return the sections."""
        lines: list[str] = []
        for home, names in modules().items():
            title = home.removeprefix(f'{CORE}.')
            lines += [
                title,
                '-' * len(title),
                '',
                f'.. automodule:: {home}',
                '   :no-members:',
                '',
            ]
            for name in names:
                value = getattr(import_module(CORE), name)
                kind = 'autodata'
                options = ['   :no-value:']
                if inspect.isclass(value):
                    fields = ','.join(getattr(value, '_fields', ()))
                    kind, options = 'autoclass', ['   :members:', f'   :exclude-members: {fields}']
                elif callable(value):
                    kind, options = 'autofunction', []
                lines += [f'.. {kind}:: {home}.{name}', *options, '']
        section = nodes.section()
        section.document = self.state.document
        nested_parse_with_titles(self.state, StringList(lines, 'api'), section)
        return section.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive('api-reference', ApiReference)
    return {'parallel_read_safe': True}
