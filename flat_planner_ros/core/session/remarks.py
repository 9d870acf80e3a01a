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

"""What looks like a mistake about a goal that breaks no rule: units, stamps, another start."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from math import tau

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.planning import OWN_LAWS, Plan, PlanSamples
from flat_planner_ros.core.session.allowance import Allowance
from flat_planner_ros.core.session.goal import Goal
from flat_planner_ros.core.session.motion_start import MotionStart
from flat_planner_ros.core.session.settings import SessionSettings
from flat_planner_ros.core.session.timeline import Motion
import numpy as np

STEEP = 1.0 / 3.0
"""Share of its peak by which an effort may change within one sample [-]; the paper's: 1/6."""

ROUNDING = 1e-9
"""Part of a turn that does not count as more than one [-]."""


def remarks_finder(
    settings: SessionSettings,
    goal: Goal,
    start: MotionStart,
    now: float,
    hurry: tuple[str, ...],
) -> Callable[[Motion], tuple[str, ...]]:
    """
    Return what tells all that is to be said of a motion, which its command need not wait for.

    Parameters
    ----------
    settings, goal, start, now
        As for `remarks_on`.
    hurry
        What `hurry_remarks` has found.

    """
    # Whoever keeps a motion does not keep the one before it.
    start = start._replace(running=None)

    def found(motion: Motion) -> tuple[str, ...]:
        """Return the clauses."""
        layers = layer_remarks(settings, motion.plan, motion.samples)
        return (*remarks_on(settings, goal, start, now), *layers, *hurry)

    return found


def remarks_on(
    settings: SessionSettings, goal: Goal, start: MotionStart, now: float
) -> Iterator[str]:
    """
    Return a clause on everything about a goal that looks like a mistake.

    Parameters
    ----------
    settings
        With limits and tolerances.
    goal
        A checked goal.
    start
        Where its motion starts.
    now
        Present time [s].

    """
    ahead = start.time - now
    if goal.stamp is not None and ahead > settings.far_ahead:
        yield (
            f'it starts in {ahead:.0f} s only (start.far_ahead {settings.far_ahead:g} s): do the '
            f'sender and the planner go by the same clock (use_sim_time)?'
        )
    yield from goal.remarks
    yield from _remarks_on_start(settings, goal, start)
    yield from turns_remarks(settings, goal, start.pose)


def _remarks_on_start(settings: SessionSettings, goal: Goal, start: MotionStart) -> Iterator[str]:
    """Return where the arm is elsewhere than a goal's first point at time 0 has it."""
    if goal.start is None:
        return
    tolerance = settings.position_tolerance
    for name, said, true in zip(settings.joints[:-1], goal.start, start.pose, strict=False):
        if abs(said - true) > tolerance:
            yield (
                f'its first point, at time 0, has {name} at {said:.4g} rad, but the motion starts '
                f'at {true:.4g} rad (start.position_tolerance {tolerance:g} rad)'
            )


def layer_remarks(settings: SessionSettings, found: Plan, samples: PlanSamples) -> Iterator[str]:
    """
    Return where a weight asks for a boundary layer that the command is too coarse to play.

    Parameters
    ----------
    settings
        With the spacing of samples.
    found, samples
        A plan, and what is sent of it.

    """
    # They are steep by purpose, not by a weight.
    if found.options.strategy in OWN_LAWS:
        return
    efforts = samples.efforts[:, -2]  # joint n-1 alone carries the weights' layers
    step = float(np.abs(efforts[1:] - efforts[:-1]).max(initial=0.0))
    peak = float(np.abs(efforts).max())
    if step > STEEP * peak:
        yield (
            f'the effort of {settings.joints[-2]} changes by {100.0 * step / peak:.0f} % of its '
            f'peak within one sample of {settings.period:g} s: lower weights, or a shorter '
            f'sampling.period, are played more truly'
        )


def turns_remarks(settings: SessionSettings, goal: Goal, pose: FloatArray) -> Iterator[str]:
    """
    Return how many turns a joint is asked to make, if more than one and not within limits.

    Parameters
    ----------
    settings
        With position limits, which show that several turns are meant.
    goal
        A checked goal.
    pose
        Angles at the start of its motion, shape (n,) [rad].

    """
    poses = [pose.tolist(), *(point.positions for point in goal.points)]
    for joint, name in enumerate(settings.joints[:-1]):
        ways = [abs(after[joint] - before[joint]) for before, after in pairwise(poses)]
        turns = max(ways) / tau
        if turns > 1.0 + ROUNDING and not settings.has_position_limits(joint):
            yield (
                f'{name} is asked to make {turns:.3g} turns; angles are in radians, 90 '
                f'degrees are 1.5708'
            )


def hurry_remarks(settings: SessionSettings, allowance: Allowance | None) -> tuple[str, ...]:
    """
    Return what a plan lacks that had to be made before its start in motion.

    Parameters
    ----------
    settings
        With the lookahead.
    allowance
        Time that there was for planning, None if it was not limited.

    """
    if allowance is None or not allowance.was_needed:
        return ()
    return (
        f'planned in haste, for a start in motion {settings.lookahead:g} s ahead '
        f'(replan.lookahead): with more time its duration, or its times of via points, may be '
        f'better',
    )
