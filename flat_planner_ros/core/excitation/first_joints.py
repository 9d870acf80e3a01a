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

"""What is known of the first n-2 joints, and how large a motion of theirs may be."""

from math import pi
from typing import NamedTuple

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray, InvalidRequest, PlanarArm
from flat_planner_ros.core.excitation.all_joint_candidates import (
    all_joint_candidates,
    AllBounds,
    AllJointsCandidate,
)
from flat_planner_ros.core.excitation.certainty import relative_errors, ROUGH
from flat_planner_ros.core.excitation.settings import (
    ExcitationSettings,
    GROWTH,
    PLAUSIBLE,
    Room,
)
from flat_planner_ros.core.model_fit import (
    first_information,
    first_motions,
    FirstFit,
    fit_first_links,
    KINDS,
    Measurements,
    parameters_of,
    with_first_links,
)
from flat_planner_ros.core.planning import JointLimits, PlanningOptions
import numpy as np

SOUGHT_KINDS = ('inertia', 'static_moment', 'viscous_friction', 'coulomb_friction')
"""What is to become certain, of KINDS; offsets only have to be known with."""

MARGIN = 0.5
"""Margin of what is foreseen: the planner's own model stays as rough as it is [-]."""

TELLS = 0.9
"""Error if all else were known, relative to what is believed, from which nothing tells it [-]."""

ALIKE = 0.02
"""Relative difference of standard errors up to which two motions tell as much [-]."""

BACKWARD = 0.5
"""Share of the planned distance, turned the other way, that shows a wrong sign [-]."""


class Chosen(NamedTuple):
    """A motion, and standard errors relative to the scales (5 k,) before and after it."""

    candidate: AllJointsCandidate
    sought: int
    before: FloatArray
    after: FloatArray


class FirstJoints:
    """
    Chooses motions of all actuated joints, and grows joint by joint while they go as predicted.

    Parameters
    ----------
    arm, options, limits
        Model, options and limits of the planner that plans the goals.
    room
        Where the arm may be.
    settings
        What to reach, and how carefully.

    Attributes
    ----------
    shares
        Of effort limit and range that the next motion may use, shape (n-1,) [-].
    scales
        How far each parameter may reasonably be off, shape (5 k,); zero before the first motion.
    reached
        Standard errors relative to the scales, shape (5 k,) [-].
    has_held
        Whether the prediction of all joints held once.

    """

    def __init__(
        self,
        arm: PlanarArm,
        options: PlanningOptions,
        limits: JointLimits,
        room: Room,
        settings: ExcitationSettings,
    ) -> None:
        """Know what the parameter file says, roughly."""
        self._arm, self._options, self._limits = arm, options, limits
        self._room, self._settings = room, settings
        self.has_held = False
        self._attempts, self._noise = 0, settings.noise
        size = parameters_of(arm).size
        self._known = np.zeros((size, size))
        self._planned = np.zeros(arm.n - 2)
        self.shares = np.full(arm.n - 1, settings.first_share)
        self.scales = np.zeros(size)
        self.reached = np.full(size, np.inf)
        self._is_hidden = np.zeros(size, dtype=bool)
        self._is_sought = np.repeat([kind in SOUGHT_KINDS for kind in KINDS], arm.n - 2)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the parameters' names."""
        return tuple(f'{kind}[{i}]' for kind in KINDS for i in range(1, self._arm.n - 1))

    @property
    def errors(self) -> FloatArray:
        """Return standard errors relative to the scales as known or believed, shape (5 k,) [-]."""
        return relative_errors(self._known, self.scales)

    @property
    def untold(self) -> tuple[str, ...]:
        """Return what is sought and no motion that was looked at would tell."""
        hidden = self._is_sought & self._is_hidden
        return tuple(name for name, each in zip(self.names, hidden, strict=True) if each)

    @property
    def is_certain(self) -> bool:
        """Tell whether all that motions tell is as certain as wanted."""
        wanted = self._is_sought & ~self._is_hidden
        return bool((self.reached[wanted] <= self._settings.accuracy).all())

    def choose(self, here: FloatArray, estimate: PlanarArm, noise: float) -> Chosen:
        """
        Return the motion after which the least certain parameter is most certain.

        Parameters
        ----------
        here
            Measured joint angles, shape (n,) [rad].
        estimate
            The model so far.
        noise
            Standard deviation of each joint angle [rad].

        Raises
        ------
        InvalidRequest
            No motion is allowed from here.

        """
        bounds = AllBounds(limits=self._limits, room=self._room, shares=self.shares, margin=MARGIN)
        self._noise = noise
        every = np.full(self._arm.n, noise)
        found = [
            (candidate, *first_information(estimate, candidate.motion, every))
            for candidate in all_joint_candidates(
                here, self._arm, self._options, estimate, bounds, self._settings.rest
            )
        ]
        if not found:
            raise InvalidRequest(
                f'no motion of all joints from {np.array2string(here[:-1], precision=4)} rad '
                f'stays within {np.array2string(self.shares, precision=2)} of the effort limits '
                f'{np.array2string(self._room.efforts, precision=4)} N m and of the ranges; '
                'raise the limits, or let the arm swing out'
            )
        if not self.has_held:
            # Friction that nobody knows yet stops slow motions first.
            quickest = min(one.candidate.duration for one, *_ in found)
            found = [each for each in found if each[0].candidate.duration == quickest]
        self.scales = np.maximum(self.scales, np.max([scales for *_, scales in found], axis=0))
        before = relative_errors(self._known, self.scales)
        after = np.array(
            [relative_errors(self._known + told, self.scales) for _, told, _ in found]
        )
        alone = np.diag(sum((told for _, told, _ in found), self._known)) * self.scales**2
        self._is_hidden = (alone + ROUGH**-2) ** -0.5 > TELLS * ROUGH
        wanted = self._is_sought & ~self._is_hidden
        best = min(range(len(found)), key=lambda index: _worst_first(after[index][wanted]))
        chosen = found[best][0]
        self._planned = (chosen.candidate.final - here)[:-2]
        sought = int(np.argmax(np.where(wanted, before, -np.inf)))
        return Chosen(chosen, sought, before, after[best])

    def check_signs(self, measurements: Measurements) -> None:
        """Refuse joints that move the other way."""
        travelled = measurements.positions[-1, :-2] - measurements.positions[0, :-2]
        pairs = zip(travelled.tolist(), self._planned.tolist(), strict=True)
        for joint, (went, planned) in enumerate(pairs, 1):
            if went * planned < 0.0 and abs(went) > BACKWARD * abs(planned):
                raise InvalidRequest(
                    f'joint {joint} turned by {went:.3g} rad where {planned:.3g} rad were '
                    'planned: the sign of its effort or of its angle is wrong'
                )

    def learn(
        self, measurements: Measurements, newest: Measurements, estimate: PlanarArm, delay: float
    ) -> PlanarArm:
        """
        Return the model with first links as motions of all joints tell them, if that is plausible.

        Parameters
        ----------
        measurements
            Of the last motions of all joints.
        newest
            Of the last one of these.
        estimate
            The model so far; of its last two links only friction of joint n-1 matters.
        delay
            By which efforts act later than they are stamped [s].

        """
        found = self._fitted(measurements, estimate, delay)
        if found is not None:
            fit, estimate = found
            stds = np.full(self.scales.size, np.inf)
            stds[fit.free] = np.sqrt(np.diag(fit.errors))[fit.free]
            self.reached = stds / self.scales
        noise = np.full(self._arm.n, self._noise)
        for motion in first_motions(newest, delay):
            self._known += first_information(estimate, motion, noise)[0]
        return estimate

    def _fitted(
        self, measurements: Measurements, estimate: PlanarArm, delay: float
    ) -> tuple[FirstFit, PlanarArm] | None:
        """Return a fit and the model with it, None if that is no plausible arm."""
        period = 2 * pi / estimate.natural_mode().frequency
        friction = float(estimate.viscous_friction[-1]), float(estimate.coulomb_friction[-1])
        try:
            fit = fit_first_links(measurements, self._arm, period, friction, delay)
            arm = with_first_links(estimate, fit.values)
        except (FlatPlannerError, np.linalg.LinAlgError):
            return None
        inertias = slice(0, self._arm.n - 2)
        ratio = fit.values[inertias] / parameters_of(self._arm)[inertias]
        is_plausible = ((ratio > 1.0 / PLAUSIBLE) & (ratio < PLAUSIBLE)).all()
        return (fit, arm) if is_plausible else None

    def grow(self, wrong: FloatArray) -> None:
        """
        Allow more to joints whose prediction held, and give up after too many that did not.

        Parameters
        ----------
        wrong
            Misprediction of the links that each actuated joint moves, shape (n-1,) [-].

        """
        holds = wrong <= self._settings.agreement
        self.shares = np.where(holds, np.minimum(GROWTH * self.shares, 1.0), self.shares)
        if holds.all():
            self.has_held, self._attempts = True, 0
            return
        self._attempts += 1
        if self._attempts >= self._settings.most_attempts:
            joints = ', '.join(str(joint + 1) for joint in np.flatnonzero(~holds))
            raise InvalidRequest(
                f'{self._attempts} motions of all joints were mispredicted, the last by '
                f'{wrong.max():.2g} of the motion or effort, at joint {joints}: are the units '
                f'of the efforts right, is friction above {self.shares[~holds].max():.2g} of the '
                'effort limit, does something touch the arm?'
            )


def _worst_first(errors: FloatArray) -> list[int]:
    """Return what compares motions: their largest errors, of those alike the next largest."""
    steps: list[int] = np.round(np.log(np.sort(errors)[::-1]) / ALIKE).astype(int).tolist()
    return steps
