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

"""Moving pictures of an arm: what it does beside what it should, and its swing over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.figures.file_plot import plt
from matplotlib import animation
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
import numpy as np

FRAME_RATE = 25
"""Pictures in a second; a GIF counts hundredths of seconds [Hz]."""

DOTS = 80
"""Resolution of the picture [1/in]."""

CARD = '#f5f7fa'
"""Background, quiet on light and on dark pages."""

ARM, LAST_LINK, GHOST, SWING = '#1f4e79', '#d1495b', '#9aa5b1', '#d1495b'
"""Colours of the arm, of its last link, of the plan, and of the swing."""

MARGIN = 0.12
"""Room around all places that an arm comes to, relative to its length [-]."""

SWING_ROOM = 1.1
"""Height of the swing's axis, relative to the largest swing that is drawn [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """
    One arm that moves.

    Attributes
    ----------
    title
        Text above it.
    times
        Times of the samples, increasing, shape (m,) [s].
    positions
        Angles of its joints, shape (m, n) [rad].
    ghost
        Angles where it should be, at the same times, shape (m, n) [rad].

    """

    title: str
    times: FloatArray
    positions: FloatArray
    ghost: FloatArray

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return the angles at a time, and where they should be, linear between samples."""
        clock = min(max(time, float(self.times[0])), float(self.times[-1]))
        angles, wanted = (
            np.array([np.interp(clock, self.times, column) for column in table.T])
            for table in (self.positions, self.ghost)
        )
        return angles, wanted


def animate(scenes: Sequence[Scene], path: Path) -> None:
    """
    Write scenes side by side, in real time, as a GIF, or as a film where there is ffmpeg.

    Links are drawn equally long: an arm in reduced form has no lengths.

    Parameters
    ----------
    scenes
        At least one; all begin at the same time.
    path
        File, `.gif` or of a kind that ffmpeg knows.

    """
    first = float(scenes[0].times[0])
    last = max(float(scene.times[-1]) for scene in scenes)
    count = round((last - first) * FRAME_RATE) + 1
    figure, panels = _panels(scenes)
    writer: Any = animation.PillowWriter if path.suffix == '.gif' else animation.FFMpegWriter
    film = writer(fps=FRAME_RATE)
    with film.saving(figure, path, dpi=DOTS):
        for index in range(count):
            for panel in panels:
                panel.show(first + index / FRAME_RATE)
            film.grab_frame(facecolor=CARD)
    plt.close(figure)


def outline(angles: FloatArray) -> FloatArray:
    """Return the places of the joints and of the tip, links of length 1/n, shape (2, n + 1)."""
    absolute = np.cumsum(angles)
    steps = np.vstack([np.cos(absolute), np.sin(absolute)]) / len(angles)
    return np.hstack([np.zeros((2, 1)), np.cumsum(steps, axis=1)])


class _Panel:
    """What moves of one scene."""

    def __init__(self, scene: Scene, place: Axes, course: Axes, room: float) -> None:
        """Draw what stands still."""
        self._scene = scene
        place.set_title(scene.title, fontsize=11)
        place.set(aspect='equal', **_bounds(scene))
        place.axis('off')
        goal = outline(scene.ghost[-1])
        place.plot(*goal[:, -1:], marker='+', color=GHOST, markersize=14)
        (self._ghost,) = place.plot([], [], color=GHOST, linewidth=3, linestyle=':')
        (self._arm,) = place.plot([], [], color=ARM, linewidth=6, solid_capstyle='round')
        (self._link,) = place.plot([], [], color=LAST_LINK, linewidth=4, solid_capstyle='round')
        (self._joints,) = place.plot([], [], 'o', color='white', markeredgecolor=ARM)
        course.set(xlim=(scene.times[0], scene.times[-1]), ylim=(-room, room), facecolor=CARD)
        course.axhline(0.0, color=GHOST, linewidth=0.8)
        course.spines[['top', 'right']].set_visible(False)
        course.set_xlabel('time [s]', fontsize=9)
        (self._course,) = course.plot([], [], color=SWING, linewidth=1.6)

    @property
    def moving(self) -> tuple[Line2D, ...]:
        """Return what `show` moves."""
        return self._ghost, self._arm, self._link, self._joints, self._course

    def show(self, time: float) -> None:
        """Move to a time."""
        angles, wanted = self._scene.at(time)
        points = outline(angles)
        self._ghost.set_data(*outline(wanted))
        self._arm.set_data(*points[:, :-1])
        self._link.set_data(*points[:, -2:])
        self._joints.set_data(*points[:, :-1])
        past = self._scene.times <= time
        self._course.set_data(self._scene.times[past], self._scene.positions[past, -1])


def _bounds(scene: Scene) -> dict[str, tuple[float, float]]:
    """Return the limits of both axes that hold all places an arm comes to."""
    tables = np.vstack([scene.positions, scene.ghost])
    places = np.array([outline(angles) for angles in tables])
    low, high = places.min(axis=(0, 2)) - MARGIN, places.max(axis=(0, 2)) + MARGIN
    return {
        'xlim': (float(low[0]), float(high[0])),
        'ylim': (float(low[1]), float(high[1])),
    }


def _panels(scenes: Sequence[Scene]) -> tuple[Figure, list[_Panel]]:
    """Return a figure and what moves in it."""
    figure, axes = plt.subplots(
        2,
        len(scenes),
        figsize=(4.2 * len(scenes), 4.2),
        squeeze=False,
        sharex='row',
        sharey='row',
        height_ratios=(2.2, 1.0),
        layout='constrained',
        dpi=DOTS,
        facecolor=CARD,
    )
    room = SWING_ROOM * max(float(np.abs(scene.positions[:, -1]).max()) for scene in scenes)
    axes[1, 0].set_ylabel('elastic joint [rad]', fontsize=9)
    columns = zip(scenes, *axes, strict=True)
    panels = [_Panel(scene, place, course, room) for scene, place, course in columns]
    # Once is enough: nothing that moves changes the room that it takes.
    canvas: Any = figure.canvas
    canvas.draw()
    figure.set_layout_engine('none')
    # What stands still is from now on a picture in the background: the larger part of the work.
    still = np.array(canvas.buffer_rgba())
    moving = {artist for panel in panels for artist in panel.moving}
    for axis in axes.flat:
        for artist in axis.get_children():
            artist.set_visible(artist in moving)
    figure.figimage(still, zorder=-1)
    return figure, panels
