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
How a motion depends on its start, on the velocity of the base, and on the model.

A step is linear in what goes into it but for Coulomb friction, whose slopes follow from the motion
itself: one motion is simulated, and its derivatives are carried along with a matrix for each step,
exact for the steps that are taken. What an unknown has done before some state acts through that
state alone: its derivatives from there on are those by the state times what it has done.
"""

from typing import NamedTuple

from flat_planner_ros.core.arm import COULOMB_VELOCITY, FloatArray
from flat_planner_ros.core.model_fit.last_links import (
    COULOMB,
    Forcing,
    IMBALANCE,
    STATES,
    Steps,
    triples,
    VISCOUS,
)
import numpy as np

BASE = STATES + 3
"""End of the columns of a step's law for the state and for the velocity of the base."""

EFFORT, SHARES = slice(BASE, BASE + 3), slice(BASE + 3, BASE + 6)
"""Columns for the effort and for the shares of friction, in the stages of a step."""


class StepLaw(NamedTuple):
    """
    What a step makes of what goes into it.

    The state a step later and the arguments of the shares of friction in its stages, by the state,
    by the velocity of the base, by efforts, by these shares, and by what a coupling turns.

    Attributes
    ----------
    law
        Of a model, shape (7, 13), or (7, 19) with a coupling.
    changes
        Of this in models next to it, shape (models, 7, 13 or 19).

    """

    law: FloatArray
    changes: FloatArray

    @classmethod
    def of(cls, steps: Steps) -> 'StepLaw':
        """Return that of the first of some models and of those next to it."""
        models, whole, stages = steps.models, steps.whole, steps.stages
        by_state = np.hstack((whole.transition, stages.by_state / COULOMB_VELOCITY))
        by_effort = np.hstack((whole.forced, stages.by_forces / COULOMB_VELOCITY))
        by_base = models[:, VISCOUS, None, None] * by_effort
        by_base[:, STATES:] -= np.eye(3) / COULOMB_VELOCITY
        by_shares = np.zeros_like(by_effort)
        by_shares[:, :STATES] = -models[:, COULOMB, None, None] * whole.forced
        by_shares[:, 5, :1] = -stages.middle_by_first
        by_shares[:, 6, :2] = -np.hstack((stages.last_by_first, stages.last_by_second))
        parts = [by_state, by_base, by_effort, by_shares]
        if models.shape[1] > IMBALANCE:
            coupling = models[:, IMBALANCE, None, None]
            by_turning = np.zeros_like(by_effort)
            by_turning[:, :STATES] = -coupling * steps.on_last.forced
            by_turning[:, -1] = by_turning[:, 2] / COULOMB_VELOCITY
            parts += [-coupling * by_effort, by_turning]
        laws = np.concatenate(parts, axis=-1)
        return cls(laws[0], laws[1:] - laws[0])

    def direct(self, motion: FloatArray, forcing: Forcing) -> FloatArray:
        """Return derivatives with the shares of friction held, (K, 7, 7 + models, segments)."""
        effort = triples(forcing.effort)[:, forcing.variant]
        parts = [motion[:-1, :STATES], triples(forcing.base)[:, 0], effort[:, 0]]
        parts.append(_shares(motion))
        if forcing.turning is not None:
            parts += list(triples(forcing.turning).swapaxes(0, 1))
        inputs = np.concatenate(parts, axis=1)
        steps, _, segments = inputs.shape
        found = np.empty((steps, len(self.law), BASE + len(self.changes), segments))
        found[:, :, :BASE] = self.law[:, :BASE, None]
        by_model = self.changes.swapaxes(0, 1) @ inputs[:, None]
        # Where a model differs in its delay, it meets another effort.
        for place in np.flatnonzero(forcing.variant[1:] != forcing.variant[0]):
            by_model[:, :, place] += self.law[:, EFFORT] @ (effort[:, 1 + place] - effort[:, 0])
        found[:, :, BASE:] = by_model
        return found


def step_slopes(law: StepLaw, motion: FloatArray, forcing: Forcing) -> FloatArray:
    """
    Return the derivatives of the states a step later, shape (K, segments, 4, 7 + models).

    By the state before it, by the velocity of the base at its start, middle and end, and along the
    way to each of the models next to that which moves.

    Parameters
    ----------
    law
        Of a step.
    motion
        As `last_links.motions` returns it for the model, shape (K + 1, 4 or 7, segments).
    forcing
        What moves it, and the models next to it.

    """
    direct = law.direct(motion, forcing)
    flat = 1.0 - _shares(motion) ** 2
    mixed = law.law[STATES:, SHARES]
    by_friction = np.empty((len(flat), 3, *direct.shape[2:]))
    for stage in range(3):
        argument = direct[:, STATES + stage]
        for before in range(stage):
            argument = argument + mixed[stage, before] * by_friction[:, before]
        np.multiply(flat[:, stage, None], argument, out=by_friction[:, stage])
    count, _, *rest = by_friction.shape
    by_stage = law.law[:STATES, SHARES] @ by_friction.reshape(count, 3, -1)
    found = direct[:, :STATES] + by_stage.reshape(count, STATES, *rest)
    return np.ascontiguousarray(found.transpose(0, 3, 1, 2))


def _shares(motion: FloatArray) -> FloatArray:
    """Return the shares of friction in all steps, shape (K, 3, segments)."""
    found = motion[:-1, STATES:]
    return found if found.size else np.zeros((len(found), 3, motion.shape[-1]))


def carried_on(by_step: FloatArray, by_base: FloatArray) -> FloatArray:
    """
    Return the derivatives of all states by the first one, and by what acts from there on.

    Shape (K + 1, segments, 4, 4 + models + unknowns).

    Parameters
    ----------
    by_step
        As `step_slopes` returns it.
    by_base
        Derivatives of the base's velocity by unknowns on a grid of half steps, shape
        (2 K + 1, segments, unknowns).

    """
    steps, segments = by_step.shape[:2]
    direct = STATES + by_step.shape[-1] - BASE
    found = np.zeros((steps + 1, segments, STATES, direct + by_base.shape[-1]))
    found[0, ..., :STATES] = np.eye(STATES)
    found[1:, ..., STATES:direct] = by_step[..., BASE:]
    np.matmul(by_step[..., STATES:BASE], triples(by_base), out=found[1:, ..., direct:])
    by_state = np.ascontiguousarray(by_step[..., :STATES])
    carried = np.empty_like(found[0])
    for matrices, before, after in zip(by_state, found[:-1], found[1:], strict=True):
        np.matmul(matrices, before, out=carried)
        after += carried
    return found
