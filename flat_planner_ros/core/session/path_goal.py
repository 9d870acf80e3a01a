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

"""Goals from trajectories that a motion planner has made for another law of motion."""

from collections.abc import Sequence
from dataclasses import replace

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.session.goal import Goal, GoalPoint, MAX_POINTS
import numpy as np

PATH_TOLERANCE = 0.01
"""Distance from the path of such a trajectory up to which a point of it is not passed [rad]."""


def path_goal(goal: Goal) -> Goal:
    """
    Return the goal to follow the path of a trajectory that a motion planner has made.

    Its velocities and accelerations are those of another law, and its points are many. To pass all
    of them in time would be to copy that law, which an elastic joint can do at a thousandfold
    effort only: passed are the corners of its path. Points without derivatives are a user's, and
    are left as they are while a goal can have as many. What was changed is said in the remarks.
    """
    first = 1 if goal.begins_with_start else 0
    way = goal.points[first:-1]
    is_copied = any(any(point.velocities + point.accelerations) for point in way)
    if not (is_copied or len(goal.points) > MAX_POINTS) or not _is_whole(goal):
        return goal
    path = np.array([point.positions for point in goal.points])
    corners = [k for k in _corners(path, PATH_TOLERANCE) if first <= k < len(path) - 1]
    if not first and 0 not in corners:
        corners.insert(0, 0)  # how the arm comes to the first point is not known here
    passed = [_without_derivatives(goal.points[k]) for k in corners]
    remark = (
        f'{len(passed)} of its {len(way)} points on the way are passed, the others are within '
        f'{PATH_TOLERANCE:g} rad of the lines between them; velocities and accelerations are left '
        'to the planner'
    )
    points = (*goal.points[:first], *passed, goal.points[-1])
    return replace(goal, points=points, remarks=(*goal.remarks, remark))


def _is_whole(goal: Goal) -> bool:
    """Tell whether every point has a finite position of every joint."""
    count = len(goal.joint_names)
    positions = [point.positions for point in goal.points]
    return all(len(row) == count for row in positions) and bool(np.isfinite(positions).all())


def _without_derivatives(point: GoalPoint) -> GoalPoint:
    """Return a point that is passed as the planner likes."""
    return replace(point, velocities=(), accelerations=())


def _corners(path: FloatArray, tolerance: float) -> Sequence[int]:
    """Return the points whose polygon is within a tolerance of all of them (Douglas, Peucker)."""
    corners, spans = {0, len(path) - 1}, [(0, len(path) - 1)]
    while spans:
        begin, end = spans.pop()
        if end - begin < 2:
            continue
        off = _distances(path[begin + 1 : end], path[begin], path[end])
        farthest = int(off.argmax())
        if off[farthest] > tolerance:
            corner = begin + 1 + farthest
            corners.add(corner)
            spans += [(begin, corner), (corner, end)]
    return sorted(corners)


def _distances(points: FloatArray, begin: FloatArray, end: FloatArray) -> FloatArray:
    """Return how far points are from a segment, shape (m,) [rad]."""
    along = end - begin
    length = float(along @ along)
    shares = (points - begin) @ along / length if length else np.zeros(len(points))
    nearest = begin + np.clip(shares, 0.0, 1.0)[:, None] * along
    distances: FloatArray = np.linalg.norm(points - nearest, axis=1)
    return distances
