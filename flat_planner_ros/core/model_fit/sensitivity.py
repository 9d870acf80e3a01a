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

"""
How a motion depends on its start and on the velocity of the base.

A step is linear in both but for Coulomb friction, whose slopes follow from the motion itself: one
motion is simulated, and its derivatives are carried along with a matrix for each step, exact for
the steps that are taken. What an unknown has done before some state acts through that state alone:
its derivatives from there on are those by the state times what it has done.
"""

from flat_planner_ros.core.arm import COULOMB_VELOCITY, FloatArray
from flat_planner_ros.core.model_fit.last_links import (
    COULOMB,
    linear_flow,
    Stages,
    STATES,
    triples,
    VISCOUS,
)
import numpy as np


def step_slopes(model: FloatArray, motion: FloatArray, step: float) -> FloatArray:
    """
    Return the derivatives of the states a step later, shape (K, segments, 4, 7).

    By the state before it, and by the velocity of the base at its start, middle and end.

    Parameters
    ----------
    model
        Parameters in the order of `last_links.NAMES`, shape (1, 8).
    motion
        As `last_links.motions` returns it for the model, shape (K + 1, 4 or 7, segments).
    step
        Between its states [s].

    """
    whole = linear_flow(model, step)
    pushed = model[0, VISCOUS] * whole.forced[0]
    without = np.concatenate((whole.transition[0], pushed), axis=-1)
    shares = motion[:-1, STATES:].swapaxes(0, 1)[..., None]
    if not shares.size:
        return np.broadcast_to(without, (len(motion) - 1, motion.shape[-1], *without.shape))
    stages = Stages.of(model, step, whole)
    by_base = model[0, VISCOUS] * stages.by_forces[0] - np.eye(3)
    by_stage = np.concatenate((stages.by_state[0], by_base), axis=-1) / COULOMB_VELOCITY
    first, middle, last = 1.0 - shares**2
    by_first = first * by_stage[0]
    by_middle = middle * (by_stage[1] - stages.middle_by_first * by_first)
    earlier = stages.last_by_first * by_first + stages.last_by_second * by_middle
    by_friction = np.stack((by_first, by_middle, last * (by_stage[2] - earlier)), axis=-2)
    found: FloatArray = without - model[0, COULOMB] * whole.forced[0] @ by_friction
    return found


def carried_on(by_step: FloatArray, by_base: FloatArray | None) -> FloatArray:
    """
    Return the derivatives of all states by the first one and by unknowns that act from there on.

    Shape (K + 1, segments, 4, 4 + unknowns).

    Parameters
    ----------
    by_step
        As `step_slopes` returns it.
    by_base
        Derivatives of the base's velocity by the unknowns on a grid of half steps, shape
        (2 K + 1, segments, unknowns); None for no unknowns.

    """
    steps, segments = by_step.shape[:2]
    unknowns = 0 if by_base is None else by_base.shape[-1]
    found = np.zeros((steps + 1, segments, STATES, STATES + unknowns))
    found[0, ..., :STATES] = np.eye(STATES)
    if by_base is not None:
        np.matmul(by_step[..., STATES:], triples(by_base), out=found[1:, ..., STATES:])
    by_state = np.ascontiguousarray(by_step[..., :STATES])
    carried = np.empty_like(found[0])
    for matrices, before, after in zip(by_state, found[:-1], found[1:], strict=True):
        np.matmul(matrices, before, out=carried)
        after += carried
    return found
