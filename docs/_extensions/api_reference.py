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

"""Directives `api-names` and `api-wing`: what is on the public lists of the core, documented."""

from importlib import import_module
import inspect
from types import GenericAlias

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

CORE = 'flat_planner_ros.core'


def entry(module: str, name: str) -> list[str]:
    """Return the lines that document a name of a public list."""
    value = getattr(import_module(module), name)
    if inspect.isclass(value):
        fields = ','.join(getattr(value, '_fields', ()))
        kind, options = 'autoclass', ['   :members:', f'   :exclude-members: {fields}']
        bases = [base for base in value.__bases__ if base.__module__.startswith(CORE)]
        if bases and not issubclass(value, Exception):
            options.append('   :inherited-members:')
    elif inspect.isfunction(value):
        kind, options = 'autofunction', []
    elif isinstance(value, GenericAlias):
        return []  # a name for a type, of which there is no more to say than its value
    else:
        kind, options = 'autodata', ['   :no-value:']
    return [f'.. {kind}:: {module}.{name}', *options, '']


class ApiNames(SphinxDirective):
    """Names of the front door, in the order in which they are written."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return their documentation."""
        lines = [line for name in ' '.join(self.content).split() for line in entry(CORE, name)]
        return self.parse_content_to_nodes_of(lines)

    def parse_content_to_nodes_of(self, lines: list[str]) -> list[nodes.Node]:
        """Return what lines of reStructuredText become."""
        container = nodes.section()
        container.document = self.state.document
        self.state.nested_parse(StringList(lines, 'api'), 0, container)
        return container.children


class ApiWing(ApiNames):
    """All public names of a wing that the front door does not have."""

    has_content = False
    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return what the wing says of itself, and the documentation of its names."""
        home = f'{CORE}.{self.arguments[0]}'
        wing, front = import_module(home), import_module(CORE)
        at_the_door = [name for name in wing.__all__ if name in front.__all__]
        lines = [(inspect.getdoc(wing) or '').partition(': ')[2], '']
        if at_the_door:
            names = ', '.join(f'``{name}``' for name in at_the_door)
            lines += [f'At the :doc:`front door <index>`: {names}.', '']
        for name in wing.__all__:
            if name not in front.__all__:
                lines += entry(home, name)
        return self.parse_content_to_nodes_of(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives."""
    app.add_directive('api-names', ApiNames)
    app.add_directive('api-wing', ApiWing)
    return {'parallel_read_safe': True}
