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

from flat_planner_ros.core.arm import coulomb_share, COULOMB_VELOCITY, FloatArray
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
    step
        Time from one state to the next [s].
    effort
        Of joint n-1, for some models, shape (2 K + 1, variants, segments) [N m].
    variant
        Which of them each model takes, shape (models,).
    base
        Angular velocity of the link before n-1, shape (2 K + 1, segments) [rad/s].
    turning
        What a coupling of both links takes from link n-1 and from link n for each unit, besides
        its part in the mass matrix, shape (2 K + 1, 2, segments) [rad/s^2]; None for nothing.

    """

    step: float
    effort: FloatArray
    variant: npt.NDArray[np.intp]
    base: FloatArray
    turning: FloatArray | None = None


class _Flow(NamedTuple):
    """Transition (P, 4, 4), and what forces at the start, middle and end add (P, 4, 3)."""

    transition: FloatArray
    forced: FloatArray


def step_for(parameters: FloatArray, has_friction: bool) -> float:
    """Return the longest step for a model, shape (8,) [s]."""
    stiffest = np.sqrt(parameters[STIFFNESS] / parameters[LAST]) + 1e-9
    step = min(FREE_STEP, 0.2 / float(stiffest))
    if has_friction:
        link = parameters[BOTH] - parameters[LAST]
        rate = abs(parameters[COULOMB]) / COULOMB_VELOCITY / link + 1e-9
        step = min(step, FRICTION_STEP, STIFF_SHARE / float(rate))
    return step


def trajectories(models: FloatArray, starts: FloatArray, forcing: Forcing) -> FloatArray:
    """
    Return the motion of every model from every start.

    Parameters
    ----------
    models
        Parameters in the order of NAMES, shape (models, 8); offset and delay are not used: the
        former is added to what is seen, the latter is in the forcing.
    starts
        States at the first time, shape (models, 4, segments) [rad], [rad/s].
    forcing
        What moves them.

    Returns
    -------
    FloatArray
        States, shape (K + 1, models, 4, segments).

    """
    steps = (forcing.base.shape[0] - 1) // 2
    states = np.empty((steps + 1, *starts.shape))
    states[0] = starts
    whole = _linear_flow(models, forcing.step)
    # Viscous friction of the link's own rate is in the transition; what the base adds is a force.
    drag = models[:, VISCOUS, None] * forcing.base[:, None, :]
    forces = forcing.effort[:, forcing.variant] + drag
    pushed: FloatArray | float = 0.0
    if forcing.turning is not None:
        taken = models[:, IMBALANCE, None] * forcing.turning[:, :, None]
        forces = forces - taken[:, 0]
        last = _linear_flow(models, forcing.step, on_last=True)
        pushed = last.forced @ _triples(-taken[:, 1])
    triples = _triples(forces)
    pushed = pushed + whole.forced @ triples
    if models[:, COULOMB].any():
        half = _linear_flow(models, forcing.step / 2)
        _add_with_friction(states, pushed, triples, models, forcing.base, whole, half)
        return states
    for k in range(steps):
        states[k + 1] = whole.transition @ states[k] + pushed[k]
    return states


def _triples(forces: FloatArray) -> FloatArray:
    """Return the forces at start, middle and end of every step, shape (K, models, 3, segments)."""
    return np.stack((forces[:-2:2], forces[1:-1:2], forces[2::2]), axis=-2)


def _linear_flow(models: FloatArray, step: float, *, on_last: bool = False) -> _Flow:
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
    return _Flow(flow[:, :, :STATES], np.stack(forced, axis=-1))


def _exponential(matrices: FloatArray) -> FloatArray:
    """Return the exponentials of a stack of matrices; steps are short, so their series is."""
    # Not scipy's: it is slow to import, and its threads get into each other's way.
    total = term = np.broadcast_to(np.eye(matrices.shape[-1]), matrices.shape)
    for order in range(1, TERMS + 1):
        term = term @ matrices / order
        total = total + term
    return total


def _add_with_friction(
    states: FloatArray,
    pushed: FloatArray,
    triples: FloatArray,
    models: FloatArray,
    base: FloatArray,
    whole: _Flow,
    half: _Flow,
) -> None:
    """Fill in the states one by one; velocities for Coulomb friction are predicted in stages."""
    coulomb = models[:, COULOMB, None]
    # Of the first half step only the velocity of link n-1 is wanted.
    flow = np.concatenate((whole.transition, half.transition[:, 2:3]), axis=1)
    first, middle = triples[..., 0, :], triples[..., 1, :]
    near = np.stack((first, (first + middle) / 2, middle), axis=-2)
    pushed_half = (half.forced[:, 2:3] @ near)[:, :, 0]
    by_half = half.forced[:, 2].sum(axis=1)[:, None]
    by_first, by_middle, by_last = (column[:, None] for column in whole.forced[:, 2].T)
    by_start, by_second = by_first - by_last, by_middle + 2 * by_last
    drags = np.empty((len(models), 3, states.shape[-1]))
    for k, push in enumerate(pushed):
        free = flow @ states[k]
        # To the middle with the friction of the start, to the end with that of the middle.
        held = coulomb * coulomb_share(states[k, :, 2] - base[2 * k])
        velocity = free[:, 4] + pushed_half[k] - by_half * held
        second = coulomb * coulomb_share(velocity - base[2 * k + 1])
        velocity = free[:, 2] + push[:, 2] - by_start * held - by_second * second
        drags[:, 0], drags[:, 1] = held, second
        drags[:, 2] = coulomb * coulomb_share(velocity - base[2 * k + 2])
        states[k + 1] = free[:, :STATES] + push - whole.forced @ drags
