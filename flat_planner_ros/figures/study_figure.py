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

"""Pictures of studies: a map, curves or a distribution, drawn with matplotlib (extra `plot`)."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray
from flat_planner_ros.core.session import Motion
from flat_planner_ros.core.study import Case
from flat_planner_ros.figures.file_plot import plt
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm, Normalize
import numpy as np

COLOURS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000')
"""Of curves: those of Okabe and Ito, which colour-blind people tell apart."""

LINES = ('-', '--', '-.', ':')
"""Of curves, which are told apart without colours too."""

MAP = 'viridis'
"""Colours of a map: from dark to light in print, too."""

REFUSED = '#cccccc'
"""Colour of what has no value."""

WIDE = 100.0
"""Ratio of the largest to the smallest value from which a scale is logarithmic [-]."""

SAME = 1e-6
"""Difference of ratios or distances of neighbours that is none, relative to them [-]."""

FEW = 60
"""Different values of an axis up to which each is a place of its own, not a cloud."""

BESIDE = 0.5
"""Part of the way from one name to the next over which the values of a family spread [-]."""

MOST_CELLS = 30
"""Most parts of an axis into which a cloud is sorted."""

SPARSE = 0.4
"""Share of a map's cells that rows meet below which it is drawn as points [-]."""

TICKS = 7
"""Most parts into which the marks below a picture divide it, so that long numbers have room."""

FAMILY = 12
"""Most curves of a family, if each is of one value."""

RANGES = 4
"""Curves of a family with more values, each of a range."""

BAND = (0.1, 0.9)
"""Quantiles between which a band lies about a curve."""

BANDS = 'median, and between which values eight of ten rows lie'
"""What a picture with bands says of them."""


class NothingToDraw(FlatPlannerError):
    """All rows are refused, or have no value."""


class Shown(NamedTuple):
    """Title of a column, how it is called with its unit, and its values, shape (m,)."""

    title: str
    label: str
    values: Sequence[Any]

    @property
    def is_number(self) -> bool:
        """Tell whether the values are numbers."""
        return all(isinstance(value, float) for value in self.values)

    @property
    def places(self) -> tuple[FloatArray, list[str]]:
        """Return where the values are on an axis, and what stands there if they are no numbers."""
        if self.is_number:
            return np.array(self.values, dtype=float), []
        names = list(dict.fromkeys(map(str, self.values)))
        return np.array([float(names.index(str(value))) for value in self.values]), names


def draw(
    value: Shown, path: Path, *, x: Shown | None = None, y: Shown | None = None, by: Shown | None
) -> None:
    """
    Draw a value.

    Parameters
    ----------
    value
        NaN in rows without one, which are those that are refused.
    path
        File to write; its suffix chooses the format.
    x
        Over what; without it the picture is a distribution.
    y
        With x, the picture is a map.
    by
        What tells curves, or distributions, apart.

    """
    figure, axis = plt.subplots(figsize=(7.0, 4.8))
    value, x, y, by = _placed(value, x, y, by)
    if x is None:
        _distribution(axis, value, by)
    elif y is None:
        _curves(axis, x, value, by)
    else:
        _map(axis, x, y, value)
    figure.tight_layout()
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _placed(
    value: Shown, *axes: Shown | None
) -> tuple[Shown, Shown | None, Shown | None, Shown | None]:
    """Return columns without the rows that have no place on an axis, such as refused ones."""
    given = [axis for axis in axes if axis is not None]
    found = np.ones(len(value.values), dtype=bool)
    for axis in given:
        found &= np.isfinite(axis.places[0])
    if not found.any():
        raise NothingToDraw(f'no row has a value of {" and ".join(axis.title for axis in given)}')
    keep = np.flatnonzero(found).tolist()
    x, y, by = (
        None if axis is None else axis._replace(values=[axis.values[row] for row in keep])
        for axis in axes
    )
    return value._replace(values=[value.values[row] for row in keep]), x, y, by


def draw_row(case: Case, motion: Motion, path: Path) -> None:
    """Draw the motion of one row: planned angles and the efforts that they take."""
    figure, (above, below) = plt.subplots(2, sharex=True, figsize=(7.0, 5.5))
    samples, joints = motion.samples, case.settings.joints
    styles = zip(cycle(COLOURS), cycle(LINES), strict=False)
    for index, (name, (colour, line)) in enumerate(zip(joints, styles, strict=False)):
        above.plot(samples.times, samples.positions[:, index], line, color=colour, label=name)
        if index < len(joints) - 1:
            below.plot(samples.times, samples.efforts[:, index], line, color=colour)
    above.set_ylabel('planned angle [rad]')
    below.set_ylabel('effort [N m]')
    below.set_xlabel('time [s]')
    above.legend(frameon=False)
    above.set_title(f'{motion.plan.options.strategy.value}, {motion.plan.duration:.4g} s')
    for axis in (above, below):
        axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _distribution(axis: Axes, value: Shown, by: Shown | None) -> None:
    """Draw which share of the rows stays below a value."""
    for name, rows, style in _families(value, by):
        values = np.array(value.values, dtype=float)[rows]
        known = np.sort(values[np.isfinite(values)])
        # Refused rows never get there: the curve ends below one.
        shares = np.arange(1.0, len(known) + 1.0) / max(len(values), 1)
        axis.step(known, shares, where='post', label=name, **style)
    _scale(axis.set_xscale, value)
    axis.set_xlabel(value.label)
    axis.set_ylabel('share of rows at or below [-]')
    axis.set_ylim(0.0, 1.02)
    _finish(axis, by)


def _curves(axis: Axes, x: Shown, value: Shown, by: Shown | None) -> None:
    """Draw the median over an axis, with a band where rows spread."""
    places, names = x.places
    values, has_bands = np.array(value.values, dtype=float), False
    families = _families(value, by)
    for index, (name, rows, style) in enumerate(families):
        here, found = places[rows], values[rows]
        centres, cells = _cells(here)
        middle, low, high = (
            np.array([_quantile(found[cells == k], share) for k in range(len(centres))])
            for share in (0.5, *BAND)
        )
        has_bands |= bool((high > low).any())
        if names:
            spread, look = np.array([middle - low, high - middle]), {**style, 'linestyle': ''}
            beside = centres + BESIDE * ((index + 0.5) / len(families) - 0.5)
            axis.errorbar(beside, middle, spread, label=name, marker='o', capsize=3, **look)
            continue
        axis.plot(centres, middle, label=name, marker='.', **style)
        if has_bands:
            axis.fill_between(centres, low, high, color=style['color'], alpha=0.15, linewidth=0.0)
    if names:
        axis.set_xticks(range(len(names)), names, rotation=20, ha='right')
        axis.margins(x=0.2)
    else:
        axis.locator_params(axis='x', nbins=TICKS)
    _scale(axis.set_yscale, value)
    axis.set_xlabel(x.label)
    axis.set_ylabel(value.label)
    if has_bands:
        axis.set_title(BANDS, fontsize=9)
    _finish(axis, by)


def _map(axis: Axes, x: Shown, y: Shown, value: Shown) -> None:
    """Draw the median in the cells of two axes; cells whose rows are all refused are grey."""
    (across, across_names), (up, up_names) = x.places, y.places
    values = np.array(value.values, dtype=float)
    axis.set_xlabel(x.label)
    axis.set_ylabel(y.label)
    axis.locator_params(axis='x', nbins=TICKS)
    for place, names in ((axis.set_xticks, across_names), (axis.set_yticks, up_names)):
        if names:
            place(range(len(names)), names)
    (columns, column), (rows, row) = _cells(across), _cells(up)
    table = np.full((len(rows), len(columns)), np.nan)
    is_met = np.zeros(table.shape, dtype=bool)
    for i, j in set(zip(row.tolist(), column.tolist(), strict=True)):
        is_met[i, j] = True
        table[i, j] = _quantile(values[(row == i) & (column == j)], 0.5)
    if is_met.mean() < SPARSE:
        _cloud(axis, columns, rows, np.ma.masked_where(~is_met, table), value.label)
        return
    drawn = axis.pcolormesh(
        _edges(columns), _edges(rows), table, cmap=MAP, norm=_norm(table), rasterized=True
    )
    axis.figure.colorbar(drawn, ax=axis, label=f'{value.label}, median')
    refused = np.ma.masked_where(~(is_met & np.isnan(table)), np.zeros(table.shape))
    if refused.count():
        axis.pcolormesh(_edges(columns), _edges(rows), refused, cmap=ListedColormap([REFUSED]))
        axis.set_title('grey: refused', fontsize=9)
    for set_scale, centres in ((axis.set_xscale, columns), (axis.set_yscale, rows)):
        if _is_geometric(centres):
            set_scale('log')


def _cloud(
    axis: Axes, columns: FloatArray, rows: FloatArray, table: np.ma.MaskedArray, label: str
) -> None:
    """Draw the median as points where rows meet too few cells for a map; crosses are refused."""
    up, across = np.nonzero(~np.ma.getmaskarray(table))
    values = table.data[up, across]
    known = np.isfinite(values)
    drawn = axis.scatter(
        columns[across[known]], rows[up[known]], 25.0, values[known], cmap=MAP, norm=_norm(values)
    )
    axis.figure.colorbar(drawn, ax=axis, label=f'{label}, median')
    if not known.all():
        axis.plot(columns[across[~known]], rows[up[~known]], 'x', color='gray', markersize=4)
        axis.set_title('crosses: refused', fontsize=9)
    axis.grid(alpha=0.3)


def _families(
    value: Shown, by: Shown | None
) -> Sequence[tuple[str, np.typing.NDArray[np.intp], Mapping[str, Any]]]:
    """Return name, rows and style of each curve; of many values, some ranges with equal shares."""
    count = len(value.values)
    if by is None:
        return [('', np.arange(count), {'color': COLOURS[0], 'linestyle': '-'})]
    places, names = by.places
    kept = np.unique(places)
    if len(kept) > FAMILY:
        edges = np.quantile(places, np.linspace(0.0, 1.0, RANGES + 1))
        places = np.searchsorted(edges[1:-1], places, side='right').astype(float)
        kept = np.unique(places)
        limits = [f'{edge:.3g}' for edge in edges.tolist()]
        names = [f'{low} to {high}' for low, high in zip(limits[:-1], limits[1:], strict=True)]
    found: list[tuple[str, np.typing.NDArray[np.intp], Mapping[str, Any]]] = []
    for index, place in enumerate(kept.tolist()):
        style = {'color': COLOURS[index % len(COLOURS)], 'linestyle': LINES[index % len(LINES)]}
        label = names[int(place)] if names else f'{place:.4g}'
        found.append((label, np.flatnonzero(places == place), style))
    return found


def _cells(places: FloatArray) -> tuple[FloatArray, np.typing.NDArray[np.intp]]:
    """Return the centres of an axis's cells, and in which of them each place is."""
    centres, cells = np.unique(places, return_inverse=True)
    if len(centres) <= FEW:
        return centres, cells
    # Some rows in each cell of a map of two such axes.
    count = min(MOST_CELLS, int(0.5 * np.sqrt(len(centres))) + 3)
    edges = np.linspace(places.min(), places.max(), count + 1)
    inside = np.clip(np.searchsorted(edges, places) - 1, 0, count - 1)
    return 0.5 * (edges[:-1] + edges[1:]), inside


def _edges(centres: FloatArray) -> FloatArray:
    """Return the borders of cells about their centres."""
    if len(centres) == 1:
        return np.array([centres[0] - 0.5, centres[0] + 0.5])
    if _is_geometric(centres):
        return np.exp(_middles(np.log(centres)))
    return _middles(centres)


def _is_geometric(centres: FloatArray) -> bool:
    """Tell whether the ratio of neighbours is the same throughout, and not their distance."""
    if len(centres) < 3 or centres[0] <= 0.0:
        return False
    ratios, steps = np.diff(np.log(centres)), np.diff(centres)
    return bool(np.ptp(ratios) < SAME * ratios[0] and np.ptp(steps) > SAME * steps[0])


def _middles(centres: FloatArray) -> FloatArray:
    """Return what lies between places, and as far beyond the first and the last."""
    middle = 0.5 * (centres[:-1] + centres[1:])
    ends = 2.0 * centres[[0, -1]] - middle[[0, -1]]
    return np.concatenate([ends[:1], middle, ends[1:]])


def _quantile(values: FloatArray, share: float) -> float:
    """Return a quantile of what is finite, NaN if nothing is."""
    known = values[np.isfinite(values)]
    return float(np.quantile(known, share)) if known.size else np.nan


def _is_wide(values: FloatArray) -> bool:
    """Tell whether values want a logarithmic scale."""
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() > 0.0 and known.max() > WIDE * known.min())


def _norm(table: FloatArray) -> Normalize:
    """Return how values become colours."""
    return LogNorm() if _is_wide(table) else Normalize()


def _scale(set_scale: Any, value: Shown) -> None:
    """Make an axis logarithmic where its values spread."""
    if _is_wide(np.array(value.values, dtype=float)):
        set_scale('log')


def _finish(axis: Axes, by: Shown | None) -> None:
    """Add the grid and the legend."""
    axis.grid(alpha=0.3, which='both')
    if by is not None:
        axis.legend(title=by.label, frameon=False, fontsize=8)
