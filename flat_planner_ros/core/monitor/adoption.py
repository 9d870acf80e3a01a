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

"""Rules by which a planner takes over an estimate of its arm."""

from dataclasses import dataclass, replace
from math import isfinite

from flat_planner_ros.core.arm import check_number, FlatPlannerError, InvalidRequest, PlanarArm
from flat_planner_ros.core.monitor.identification import ActuatedJoints, oscillating_inertia
from flat_planner_ros.core.monitor.model_estimate import LastLinks

INERTIA_TOLERANCE = 1e-6
"""Largest difference of an estimate's nominal inertia from the planner's, relative [-]."""

AGREEMENT = 3.0
"""Standard errors within which an estimate confirms the present values [-]."""

REFINEMENT = 1e-5
"""Change relative to the present value below which nothing is gained [-]."""

SAME_START = 1e-6
"""Largest distance of the starts of one motion, from rounding to microseconds [s]."""


class AdoptionRefused(FlatPlannerError):
    """There is no estimate to adopt, or it does not fit; the message says why."""


@dataclass(frozen=True, kw_only=True)
class ReportedEstimate:
    """
    Trustworthy estimate as a monitor reports it.

    Attributes
    ----------
    start_time
        Start of the motion that it follows [s].
    joint
        Name of the passive joint.
    stiffness, stiffness_std
        Estimate and standard error [N m/rad].
    damping, damping_std
        Estimate and standard error [N m s/rad].
    case
        Whether joint n-1 was free or held.
    inertia
        Nominal inertia on which the values rest [kg m^2].

    """

    start_time: float
    joint: str
    stiffness: float
    stiffness_std: float
    damping: float
    damping_std: float
    case: ActuatedJoints
    inertia: float

    def __post_init__(self) -> None:
        """Refuse numbers without meaning."""
        check_number('start_time', self.start_time, 's', error=InvalidRequest)
        for name, unit in {'stiffness': 'N m/rad', 'inertia': 'kg m^2'}.items():
            check_number(name, getattr(self, name), unit, above=0.0, error=InvalidRequest)
        for name in ('stiffness_std', 'damping', 'damping_std'):
            unit = 'N m/rad' if name == 'stiffness_std' else 'N m s/rad'
            check_number(name, getattr(self, name), unit, lower=0.0, error=InvalidRequest)

    def is_of_motion(self, start: float) -> bool:
        """Return whether the estimate follows the motion with a start [s]."""
        return abs(self.start_time - start) <= SAME_START

    def check_basis(self, arm: PlanarArm) -> None:
        """Raise AdoptionRefused if the estimate rests on other inertias than the arm's."""
        inertia = oscillating_inertia(arm, self.case)
        if abs(self.inertia - inertia) > INERTIA_TOLERANCE * inertia:
            raise AdoptionRefused(
                f'the estimate rests on a nominal inertia of {self.inertia:.6g} kg m^2, the '
                f'model here has {inertia:.6g} kg m^2: give both nodes the same model'
            )

    def tuned(self, arm: PlanarArm) -> PlanarArm:
        """Return the arm with what is estimated."""
        return replace(arm, stiffness=self.stiffness, damping=self.damping)

    def agrees_with(self, arm: PlanarArm) -> bool:
        """Return whether the arm has these values but for the standard errors."""
        return all(
            abs(new - old) <= AGREEMENT * std + REFINEMENT * old
            for new, old, std in (
                (self.stiffness, arm.stiffness, self.stiffness_std),
                (self.damping, arm.damping, self.damping_std),
            )
        )


@dataclass(frozen=True, kw_only=True)
class ReportedModel:
    """
    Trustworthy estimate of the whole model of the last two links, as a monitor reports it.

    Attributes
    ----------
    start_time
        Start of the motion that told it [s].
    joint
        Name of the passive joint.
    values, stds
        Estimates and standard errors; infinite for friction that was not told.

    """

    start_time: float
    joint: str
    values: LastLinks
    stds: LastLinks

    def __post_init__(self) -> None:
        """Refuse numbers without meaning."""
        check_number('start_time', self.start_time, 's', error=InvalidRequest)
        for name, value in self.values._asdict().items():
            check_number(name, value, 'SI', lower=0.0, error=InvalidRequest)
        if not self.values.both > self.values.last > 0.0 < self.values.stiffness:
            raise InvalidRequest(f'no arm moves like this: {self.values}')
        if not all(std >= 0.0 for std in self.stds):
            raise InvalidRequest(f'standard errors must not be negative, got {self.stds}')

    def is_of_motion(self, start: float) -> bool:
        """Return whether the estimate is of the motion with a start [s]."""
        return abs(self.start_time - start) <= SAME_START

    def check_basis(self, arm: PlanarArm) -> None:
        """Accept any arm: the estimate rests on measured efforts alone."""

    def tuned(self, arm: PlanarArm) -> PlanarArm:
        """Return the arm with what is estimated."""
        told = LastLinks(
            *(
                new if isfinite(std) else old
                for new, std, old in zip(self.values, self.stds, LastLinks.of(arm), strict=True)
            )
        )
        return told.applied_to(arm)

    def agrees_with(self, arm: PlanarArm) -> bool:
        """Return whether the arm has these values but for the standard errors."""
        present = LastLinks.of(arm)
        return all(
            abs(new - old) <= AGREEMENT * std + REFINEMENT * old
            for new, std, old in zip(self.values, self.stds, present, strict=True)
        )


Estimate = ReportedEstimate | ReportedModel
"""What can be adopted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Adoption:
    """
    Change of the nominal model to an estimate.

    Attributes
    ----------
    estimate
        Where the new values come from.
    former, arm
        The model before and after.

    """

    estimate: Estimate
    former: PlanarArm
    arm: PlanarArm


class ModelTuner:
    """
    Keeps the last trustworthy estimate and decides whether it may be adopted.

    A report without an estimate changes nothing: stiffness and damping belong to the arm, not to
    a motion, so an earlier estimate stays valid until it has been adopted.
    """

    def __init__(self) -> None:
        """Wait for an estimate."""
        self._estimate: Estimate | None = None
        self._adopted: Estimate | None = None

    @property
    def estimate(self) -> Estimate | None:
        """Return the last trustworthy estimate."""
        return self._estimate

    def hear(self, estimate: Estimate) -> None:
        """Take a trustworthy estimate."""
        self._estimate = estimate

    def propose(self, arm: PlanarArm, joint: str) -> Adoption:
        """
        Return the change that the last estimate asks for; `mark_adopted` it once it is made.

        Parameters
        ----------
        arm
            Nominal model of the planner.
        joint
            Name of its passive joint.

        Raises
        ------
        AdoptionRefused
            There is none, it was adopted before, it rests on another model, or it confirms the
            present values.

        """
        estimate = self._estimate
        if estimate is None:
            raise AdoptionRefused('no trustworthy estimate has been reported yet')
        if estimate == self._adopted:
            raise AdoptionRefused(
                f'the estimate from the motion that started at {estimate.start_time:.3f} s has '
                f'been adopted already'
            )
        if estimate.joint != joint:
            raise AdoptionRefused(f'the estimate is of {estimate.joint}, not of {joint}')
        estimate.check_basis(arm)
        if estimate.agrees_with(arm):
            raise AdoptionRefused(
                f'nothing to adopt: the estimate confirms the present stiffness '
                f'{arm.stiffness:.6g} N m/rad and damping {arm.damping:.6g} N m s/rad'
            )
        return Adoption(estimate=estimate, former=arm, arm=estimate.tuned(arm))

    def mark_adopted(self, adoption: Adoption) -> None:
        """Remember that an adoption has been made, so that it is not made again."""
        self._adopted = adoption.estimate
