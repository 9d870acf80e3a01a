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

"""A plan in motion: its efforts on the simulated arm, beside those of a turn for a stiff arm."""

from pathlib import Path

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.monitor import PlannedMotion
from flat_planner_ros.core.planning import Plan
from flat_planner_ros.core.plant import DriveSettings, EffortProfile, rollout
from flat_planner_ros.figures.animation import animate, Scene
import numpy as np

PERIOD = 2e-3
"""Spacing of the points that are played [s]."""

AFTERWARDS = 1.5
"""Time shown after the motion [s]."""


def plan_scenes(plan: Plan, drives: DriveSettings | None = None) -> list[Scene]:
    """
    Return a plan in motion, beside the same turn as if the last joint were stiff.

    Both are played on the arm of the plan, integrated in full, and come with where they should
    be. A plan with via points stands alone.

    Parameters
    ----------
    plan
        From rest.
    drives
        What the motors are, by default pure feed-forward or ideal servos, as the plan says.

    """
    drives = drives or DriveSettings(drive=plan.options.drive)
    samples = plan.sample(PERIOD)
    planned = _played(
        f'planned: {plan.options.strategy.value}',
        plan,
        drives,
        (samples.times, samples.positions, samples.velocities, samples.efforts),
    )
    if plan.request.via:
        return [planned]
    return [_played('torque for a stiff joint', plan, drives, stiff_turn(plan)), planned]


def animate_recording(
    motion: PlannedMotion, times: FloatArray, positions: FloatArray, path: Path
) -> None:
    """
    Write a recorded motion as a moving picture, with what was planned.

    Parameters
    ----------
    motion
        What was planned.
    times, positions
        Samples, shapes (m,) [s] and (m, n) [rad]; those without all angles are left out.
    path
        File, as for `animate`.

    """
    whole = np.isfinite(positions).all(axis=1)
    wanted = np.array([motion.reference(time)[0] for time in times[whole]])
    animate(
        [
            Scene(
                title='recorded, and as planned',
                times=times[whole] - motion.start,
                positions=positions[whole],
                ghost=wanted,
            )
        ],
        path,
    )


def stiff_turn(plan: Plan) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """
    Return times, positions, velocities and efforts of the usual quintic, shapes (m,), (m, n).

    Its effort is that of an arm whose last joint does not give way: inverse dynamics as any
    controller of a rigid arm computes it.
    """
    arm = plan.problem.arm
    times = np.linspace(0.0, plan.duration, max(2, round(plan.duration / PERIOD) + 1))
    s = times[:, None] / plan.duration
    start, final = np.array(plan.request.start), np.array(plan.request.final)
    way = final - start
    positions = start + way * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    velocities = way * 30.0 * s**2 * (1.0 - s) ** 2 / plan.duration
    accelerations = way * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / plan.duration**2
    efforts = arm.rigid_effort(positions, velocities, accelerations)
    efforts[:, -1] = 0.0
    return times, positions, velocities, efforts


def _played(
    title: str,
    plan: Plan,
    drives: DriveSettings,
    course: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
) -> Scene:
    """Return what the arm does with a course."""
    times, positions, velocities, efforts = course
    velocities = velocities.copy()
    velocities[-1] = 0.0
    profile = EffortProfile(
        start=0.0,
        times=times,
        efforts=efforts[:, :-1],
        positions=positions[:, :-1],
        velocities=velocities[:, :-1],
    )
    end = plan.duration + AFTERWARDS
    run = rollout(
        plan.problem.arm, profile, end, step=PERIOD, position=plan.request.start, drives=drives
    )
    wanted = [np.interp(run.times, times, column) for column in positions.T]
    return Scene(
        title=title, times=run.times, positions=run.positions, ghost=np.column_stack(wanted)
    )
