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

"""Draw the wings of the package and who imports whom, images/wings.svg, from the imports."""

import ast
from collections.abc import Mapping
from functools import cache
from pathlib import Path
import textwrap

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

DOCS = Path(__file__).resolve().parent
PACKAGE = DOCS.parent / 'flat_planner_ros'
PICTURE = DOCS / 'images' / 'wings.svg'

WIDTH, HEIGHT = 2.5, 1.0
"""Width of a box and height of a row [in]."""

COLOURS = {'core': '#dcebf7', 'figures': '#e5f2dc', 'ros': '#f9e9d2'}
"""Fill of a box, by the folder that holds the wing."""


@cache
def wings() -> dict[str, str]:
    """Return what each wing says of itself, by its folder in the package."""
    folders = [p for parent in ('core', 'ros') for p in sorted((PACKAGE / parent).iterdir())]
    found = {}
    for folder in (*folders, PACKAGE / 'figures'):
        front = folder / '__init__.py'
        if front.is_file():
            said = ast.get_docstring(ast.parse(front.read_text('utf-8'))) or ''
            sentence = said.partition('\n')[0].partition(': ')[2]
            found[folder.relative_to(PACKAGE).as_posix()] = sentence.replace('`', '')
    return found


@cache
def imports() -> dict[str, list[str]]:
    """Return the wings from which each wing imports, in the order of the alphabet."""
    return {wing: sorted(_imported(wing)) for wing in wings()}


def description() -> str:
    """Return all that the picture shows as text; it stands in the file, too."""
    return '\n'.join(
        f'{wing}: {said} Imports: {", ".join(imports()[wing]) or "none"}.'
        for wing, said in wings().items()
    )


def _imported(wing: str) -> set[str]:
    """Return the other wings whose modules a wing imports."""
    found = set()
    for path in (PACKAGE / wing).rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text('utf-8'))):
            if isinstance(node, ast.ImportFrom) and node.module:
                found |= {w for w in wings() if _is_in(node.module, w)}
    return found - {wing}


def _is_in(module: str, wing: str) -> bool:
    """Tell whether a module belongs to a wing."""
    home = 'flat_planner_ros.' + wing.replace('/', '.')
    return f'{module}.'.startswith(f'{home}.')


def floors(edges: Mapping[str, list[str]]) -> dict[str, int]:
    """Return the length of the longest way down from each wing."""

    @cache
    def floor(wing: str) -> int:
        return max((1 + floor(other) for other in edges[wing]), default=0)

    return {wing: floor(wing) for wing in edges}


def draw() -> Figure:
    """Return the picture: a row of boxes a floor, an arrow down to each imported wing."""
    edges = imports()
    level = floors(edges)
    rows = [[w for w in edges if level[w] == k] for k in range(1 + max(level.values()))]
    columns = max(map(len, rows))
    places = {
        wing: ((i + 0.5 * (columns - len(row))) * 1.15 * WIDTH, k * 1.45 * HEIGHT)
        for k, row in enumerate(rows)
        for i, wing in enumerate(row)
    }
    figure = Figure(figsize=(1.15 * columns * WIDTH, 1.45 * len(rows) * HEIGHT))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    for wing in edges:
        for other in _direct(edges, wing):
            _arrow(axes, places[wing], places[other])
    for wing, place in places.items():
        _box(axes, place, wing)
    axes.set_xlim(-0.6 * WIDTH, (1.15 * columns - 0.55) * WIDTH)
    axes.set_ylim(-0.75 * HEIGHT, (1.45 * len(rows) - 0.7) * HEIGHT)
    axes.axis('off')
    return figure


def _direct(edges: Mapping[str, list[str]], wing: str) -> list[str]:
    """Return the imports of a wing that none of its other imports implies."""
    below = {further for other in edges[wing] for further in _reachable(edges, other)}
    return [other for other in edges[wing] if other not in below]


def _reachable(edges: Mapping[str, list[str]], wing: str) -> set[str]:
    """Return all wings below one."""
    return {w for other in edges[wing] for w in (other, *_reachable(edges, other))}


def _box(axes: Axes, place: tuple[float, float], wing: str) -> None:
    """Draw a wing: its name, and what it says of itself."""
    x, y = place
    axes.text(
        x,
        y,
        f'$\\bf{{{wing.replace("_", chr(92) + "_")}}}$\n' + textwrap.fill(wings()[wing], 34),
        ha='center',
        va='center',
        fontsize=8.5,
        bbox={
            'boxstyle': 'round,pad=0.5',
            'facecolor': COLOURS[wing.partition('/')[0]],
            'edgecolor': '#557',
        },
    )


def _arrow(axes: Axes, above: tuple[float, float], below: tuple[float, float]) -> None:
    """Draw an arrow from a wing to one that it imports."""
    axes.annotate(
        '',
        (below[0], below[1] + 0.4 * HEIGHT),
        (above[0], above[1] - 0.35 * HEIGHT),
        arrowprops={'arrowstyle': '-|>', 'color': '#557', 'linewidth': 0.9},
    )


if __name__ == '__main__':
    with rc_context({'svg.hashsalt': 'wings'}):  # the same file from the same code
        draw().savefig(PICTURE, metadata={'Description': description(), 'Date': None})
