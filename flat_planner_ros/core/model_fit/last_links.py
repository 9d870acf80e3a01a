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
The last two links of a flat arm in motion, for many models and many starts at once.

In absolute angles their rows are linear, constant and independent of the pose and of all other
joints, but for the friction of joint n-1 ((8) of docs/derivation.md):

    (I*_{n-1} - I*_n) a'' = effort + k q + c q' - friction,    I*_n (a + q)'' = -k q - c q'

with a the angle of link n-1 and q that of the passive joint. The linear part is carried from step
to step exactly, by a matrix exponential, and the force as a parabola.
"""

from typing import NamedTuple

from flat_planner_ros.core.arm import COULOMB_VELOCITY, FloatArray
import numpy as np
import numpy.typing as npt

NAMES = (
    'inertia_star.both',
    'inertia_star.last',
    'stiffness',
    'damping',
    'viscous_friction',
    'coulomb_friction',
    'offset',
    'delay',
)
"""What a motion of the last two links depends on, in the order of a vector of parameters."""

BOTH, LAST, STIFFNESS, DAMPING, VISCOUS, COULOMB, OFFSET, DELAY = range(len(NAMES))

IMBALANCE = len(NAMES)
"""Place of the coupling of both links behind these, in vectors that have one [kg m^2]."""

STATES = 4
"""Angles of link n-1 and of the passive joint, and their rates."""

FRICTION_STEP = 1.3e-3
"""Longest step where Coulomb friction acts [s]: a joint reverses within few of them."""

FREE_STEP = 6e-3
"""Longest step without [s]: the force is a parabola in it."""

STIFF_SHARE = 0.5
"""Largest decay of a velocity by Coulomb friction around rest in one step [-]."""


TERMS = 16
"""Terms of the exponential series; the next is below rounding for spectral radii up to 0.5."""


class Forcing(NamedTuple):
    """
    What moves the last two links, on a grid of half steps.

    Attributes
    ----------
    effort
        Of joint n-1, for some models, shape (2 K + 1, variants, segments) [N m].
    variant
        Which of them each model takes, shape (models,).
    base
        Angular velocity of the link before n-1, for all models or for each, shape
        (2 K + 1, 1 or models, segments) [rad/s].
    turning
        What a coupling of both links takes from link n-1 and from link n for each unit, besides
        its part in the mass matrix, shape (2 K + 1, 2, segments) [rad/s^2]; None for nothing.

    """

    effort: FloatArray
    variant: npt.NDArray[np.intp]
    base: FloatArray
    turning: FloatArray | None = None


class Flow(NamedTuple):
    """Transition (P, 4, 4), and what forces at the start, middle and end add (P, 4, 3)."""

    transition: FloatArray
    forced: FloatArray


class Stages(NamedTuple):
    """
    How the velocity of link n-1 is predicted in a step, at its start, in its middle, at its end.

    Attributes
    ----------
    by_state, by_forces
        Without friction, shapes (P, 3, 4) and (P, 3, 3).
    middle_by_first, last_by_first, last_by_second
        What the shares of friction, in the order of the stages, take from later velocities in
        units of COULOMB_VELOCITY, shape (P, 1) [-].

    """

    by_state: FloatArray
    by_forces: FloatArray
    middle_by_first: FloatArray
    last_by_first: FloatArray
    last_by_second: FloatArray

    @classmethod
    def of(cls, models: FloatArray, step: float, whole: Flow) -> 'Stages':
        """Return those of models and a step [s], whose flow over the whole step is known."""
        half = linear_flow(models, step / 2)
        rate = np.broadcast_to(np.eye(STATES)[2], (len(models), STATES))
        by_forces = np.zeros((len(models), 3, 3))
        # Half a step spans a force, the mean of that and the next one, and the next one.
        first, middle, last = half.forced[:, 2].T
        by_forces[:, 1, 0], by_forces[:, 1, 1] = first + middle / 2, middle / 2 + last
        by_forces[:, 2] = whole.forced[:, 2]
        scale = models[:, COULOMB] / COULOMB_VELOCITY
        first, middle, last = whole.forced[:, 2].T * scale
        # To the middle with the friction of the start, to the end with that of the middle.
        taken = half.forced[:, 2].sum(axis=1) * scale, first - last, middle + 2 * last
        return cls(
            np.stack((rate, half.transition[:, 2], whole.transition[:, 2]), axis=1),
            by_forces,
            *(column[:, None] for column in taken),
        )


def step_for(parameters: FloatArray, has_friction: bool) -> float:
    """Return the longest step for a model, shape (8,) [s]."""
    stiffest = np.sqrt(parameters[STIFFNESS] / parameters[LAST]) + 1e-9
    step = min(FREE_STEP, 0.2 / float(stiffest))
    if has_friction:
        link = parameters[BOTH] - parameters[LAST]
        rate = abs(parameters[COULOMB]) / COULOMB_VELOCITY / link + 1e-9
        step = min(step, FRICTION_STEP, STIFF_SHARE / float(rate))
    return step


class Steps(NamedTuple):
    """
    How models are taken from one state to the next, whatever moves them.

    Attributes
    ----------
    models
        Parameters in the order of NAMES, and IMBALANCE if one is looked for, shape (P, 8 or 9);
        offset and delay are not used: the former is added to what is seen, the latter is in the
        forcing.
    whole, on_last
        Flow over a step under forces on link n-1, and on the last one.
    stages
        Of Coulomb friction in a step.
    has_friction
        Whether it acts.

    """

    models: FloatArray
    whole: Flow
    on_last: Flow
    stages: Stages
    has_friction: bool

    @classmethod
    def of(cls, models: FloatArray, step: float, *, has_friction: bool) -> 'Steps':
        """Return steps of a length [s]."""
        whole = linear_flow(models, step)
        on_last = linear_flow(models, step, on_last=True)
        return cls(models, whole, on_last, Stages.of(models, step, whole), has_friction)

    def of_first(self) -> 'Steps':
        """Return those of the first model alone."""
        return Steps(
            self.models[:1],
            Flow(*(part[:1] for part in self.whole)),
            Flow(*(part[:1] for part in self.on_last)),
            Stages(*(part[:1] for part in self.stages)),
            self.has_friction,
        )


def trajectories(steps: Steps, starts: FloatArray, forcing: Forcing) -> FloatArray:
    """
    Return the motion of every model from every start.

    Parameters
    ----------
    steps
        Of the models.
    starts
        States at the first time, shape (models, 4, segments) [rad], [rad/s].
    forcing
        What moves them.

    Returns
    -------
    FloatArray
        States, shape (K + 1, models, 4, segments).

    """
    return motions(steps, starts, forcing)[:, :, :STATES]


def motions(steps: Steps, starts: FloatArray, forcing: Forcing) -> FloatArray:
    """
    Return the same with the shares of Coulomb friction in the stages of each step behind it.

    Shape (K + 1, models, 7, segments), or (K + 1, models, 4, segments) without; those of the last
    state, from which no step is taken, mean nothing.
    """
    models, whole = steps.models, steps.whole
    # Viscous friction of the link's own rate is in the transition; what the base adds is a force.
    drag = models[:, VISCOUS, None] * forcing.base
    forces = forcing.effort[:, forcing.variant] + drag
    turned = None
    if forcing.turning is not None:
        taken = models[:, IMBALANCE, None] * forcing.turning[:, :, None]
        forces = forces - taken[:, 0]
        turned = steps.on_last.forced @ triples(-taken[:, 1])
    if steps.has_friction:
        return _with_friction(starts, forces, turned, forcing.base, steps)
    pushed = whole.forced @ triples(forces)
    if turned is not None:
        pushed += turned
    states = np.empty((len(pushed) + 1, *starts.shape))
    states[0] = starts
    for k, push in enumerate(pushed):
        states[k + 1] = whole.transition @ states[k] + push
    return states


def triples(halves: FloatArray) -> FloatArray:
    """Return values at half steps (2 K + 1, a, b) for start, middle and end, (K, a, 3, b)."""
    return np.stack((halves[:-2:2], halves[1:-1:2], halves[2::2]), axis=-2)


def linear_flow(models: FloatArray, step: float, *, on_last: bool = False) -> Flow:
    """Return how states, and forces on link n-1 or on the last one, act a step later."""
    link, last = models[:, BOTH] - models[:, LAST], models[:, LAST]
    coupling = models[:, IMBALANCE] if models.shape[1] > IMBALANCE else np.zeros(len(models))
    # Of the inverse of the mass matrix: what a force on link n-1 and one between both links do.
    by_force = last / (link * last - coupling**2)
    between = (last + coupling) / (link * last - coupling**2)
    relative = (link + last + 2.0 * coupling) / (link * last - coupling**2)
    count = len(models)
    # The force and its first two derivatives are states of their own: one exponential for all.
    augmented = np.zeros((count, STATES + 3, STATES + 3))
    augmented[:, 0, 2] = augmented[:, 1, 3] = 1.0
    augmented[:, 2, 1] = models[:, STIFFNESS] * between
    augmented[:, 2, 2] = -models[:, VISCOUS] * by_force
    augmented[:, 2, 3] = models[:, DAMPING] * between
    augmented[:, 2, 4] = by_force
    augmented[:, 3, 1] = -models[:, STIFFNESS] * relative
    augmented[:, 3, 2] = models[:, VISCOUS] * between
    augmented[:, 3, 3] = -models[:, DAMPING] * relative
    augmented[:, 3, 4] = -between
    if on_last:
        augmented[:, 2, 4] = by_force - between
        augmented[:, 3, 4] = relative - between
    augmented[:, 4, 5] = augmented[:, 5, 6] = 1.0
    flow = _exponential(step * augmented)[:, :STATES]
    value, slope, bend = (flow[:, :, j] for j in (4, 5, 6))
    # The parabola through three forces: slope (-3, 4, -1)/h and second derivative (4, -8, 4)/h^2.
    forced = (
        value - 3 / step * slope + 4 / step**2 * bend,
        4 / step * slope - 8 / step**2 * bend,
        -slope / step + 4 / step**2 * bend,
    )
    return Flow(flow[:, :, :STATES], np.stack(forced, axis=-1))


def _exponential(matrices: FloatArray) -> FloatArray:
    """Return the exponentials of a stack of matrices; steps are short, so their series is."""
    # Not scipy's: it is slow to import, and its threads get into each other's way.
    total = term = np.broadcast_to(np.eye(matrices.shape[-1]), matrices.shape)
    for order in range(1, TERMS + 1):
        term = term @ matrices / order
        total = total + term
    return total


def _with_friction(
    starts: FloatArray,
    forces: FloatArray,
    turned: FloatArray | None,
    base: FloatArray,
    steps: Steps,
) -> FloatArray:
    """
    Return the states one by one; velocities for Coulomb friction are predicted in stages.

    A row of seven is carried on: the state, then the shares of friction at the start of the step,
    in its middle and at its end. One product takes it a step further, where the last three become
    what the velocities of link n-1 would be without the friction of that step.
    """
    models, whole, stages = steps.models, steps.whole, steps.stages
    step = np.concatenate(
        (whole.transition, -whole.forced * models[:, COULOMB, None, None]), axis=-1
    )
    flow = np.concatenate((step, stages.by_state @ step / COULOMB_VELOCITY), axis=1)
    rows = np.empty((len(forces) // 2 + 1, len(models), STATES + 3, starts.shape[-1]))
    _force(rows, starts, forces, turned, base, stages, whole.forced)
    before, carried = None, np.empty_like(rows[0])
    for row in rows:
        if before is not None:
            np.matmul(flow, before, out=carried)
            row += carried
        held, second, last = row[:, 4], row[:, 5], row[:, 6]
        np.tanh(held, out=held)
        second -= stages.middle_by_first * held
        np.tanh(second, out=second)
        last -= stages.last_by_first * held
        last -= stages.last_by_second * second
        np.tanh(last, out=last)
        before = row
    return rows


def _force(
    rows: FloatArray,
    starts: FloatArray,
    forces: FloatArray,
    turned: FloatArray | None,
    base: FloatArray,
    stages: Stages,
    whole: FloatArray,
) -> None:
    """Fill in what forces and base add to rows of `_with_friction`, and the whole first row."""
    by_state, ahead = stages.by_state, stages.by_forces
    # The velocities of a step take the forces of that step too: five at half steps, two in common.
    by_forces = np.zeros((len(whole), STATES + 3, 5))
    by_forces[:, :STATES, :3] = whole
    by_forces[:, STATES:, :3] = by_state @ whole
    by_forces[:, STATES:, 2:] += ahead
    # After the last step there is nothing ahead, and none of it is looked at.
    padded = np.concatenate((forces, np.zeros((2, *forces.shape[1:]))))
    windows = np.stack([padded[j : len(padded) - 4 + j : 2] for j in range(5)], axis=-2)
    np.matmul(by_forces, windows, out=rows[1:])
    rows[0, :, :STATES] = starts
    rows[0, :, STATES:] = by_state @ starts + ahead @ windows[0, :, :3]
    if turned is not None:
        rows[1:, :, :STATES] += turned
        rows[1:, :, STATES:] += by_state @ turned
        rows[:-1, :, STATES + 2] += turned[:, :, 2]
    past = np.concatenate((base, np.zeros((2, *base.shape[1:]))))
    rows[:, :, STATES:] -= np.stack((past[:-2:2], past[1:-1:2], past[2::2]), axis=2)
    rows[:, :, STATES:] /= COULOMB_VELOCITY
