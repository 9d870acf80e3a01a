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

"""Start of a motion from rest: as measured, as planned before, or as given."""

from collections.abc import Sequence

from flat_planner_ros.core.arm import JointSample
from flat_planner_ros.core.planning import Reason, RequestRejected
from flat_planner_ros.core.session.settings import SessionSettings, StartSource
import numpy as np


class RestStart:
    """Keep the measured state, and tell where a motion starts from rest."""

    def __init__(self) -> None:
        """Know no measurement."""
        self._measured: JointSample | None = None

    @property
    def measured(self) -> JointSample | None:
        """Return the last measured state, None before the first."""
        return self._measured

    def measure(self, sample: JointSample, timeout: float) -> None:
        """
        Take a measured state unless it comes late.

        Parameters
        ----------
        sample
            In kinematic order.
        timeout
            Age from which a measurement is stale [s].

        """
        age = 0.0 if self._measured is None else self._measured.time - sample.time
        # Far back is no late message, but a clock that was set back.
        if not 0.0 < age <= timeout:
            self._measured = sample

    def pose(
        self, settings: SessionSettings, reference: Sequence[float] | None, now: float
    ) -> Sequence[float]:
        """
        Return the start of a motion, checked against what is measured.

        Parameters
        ----------
        settings
            Source of the start, and its tolerances.
        reference
            Angles at the end of the last motion, shape (n,) [rad]; None if there has been none.
        now
            Present time [s].

        Returns
        -------
        Sequence[float]
            Angles of all joints, the elastic one relaxed, shape (n,) [rad].

        Raises
        ------
        RequestRejected
            The start is not known, or the arm does not rest there.

        """
        source = settings.start_source
        if source in (StartSource.AUTO, StartSource.MEASURED):
            measured = self._fresh(settings.measurement_timeout, now)
            planned = [*measured.positions[:-1].tolist(), 0.0]
        else:
            if source is StartSource.PARAMETER:
                planned = list(settings.start_position)
            elif reference is not None:
                planned = list(reference)
            else:
                raise RequestRejected(
                    Reason.START_STATE_UNKNOWN,
                    'start.source is reference, but there has been no motion yet',
                )
            if self._measured is None:
                return planned
            measured = self._fresh(settings.measurement_timeout, now)
        _check_at_rest(settings, measured, planned)
        return planned

    def _fresh(self, limit: float, now: float) -> JointSample:
        """Return the measured state unless there is none, or only an old one."""
        if self._measured is None:
            raise RequestRejected(
                Reason.START_STATE_UNKNOWN, 'no joint state of this arm has been received yet'
            )
        age = now - self._measured.time
        if not -limit <= age <= limit:
            raise RequestRejected(
                Reason.START_STATE_STALE,
                f'the last joint state is {age:.3f} s old, more than {limit:g} s'
                if age > 0.0
                else f'the last joint state is stamped {-age:.3f} s ahead of the present: do the '
                f'planner and its source go by the same clock (use_sim_time)?',
                value=age,
                limit=limit,
            )
        return self._measured


def _check_at_rest(
    settings: SessionSettings, measured: JointSample, planned: Sequence[float]
) -> None:
    """Refuse to start from another place, or while the arm still moves."""
    nothing = np.full(len(planned), np.nan)
    velocities = nothing if measured.velocities is None else measured.velocities
    for name, position, velocity, start in zip(
        settings.joints, measured.positions, velocities, planned, strict=True
    ):
        # Written so that a NaN position is refused and a NaN velocity is not.
        if not abs(position - start) <= settings.position_tolerance:
            raise RequestRejected(
                Reason.START_STATE_MISMATCH,
                f'{name} is measured at {position:.4g} rad, not at the start {start:.4g} rad '
                f'(tolerance {settings.position_tolerance:g} rad)',
                joint=name,
                value=float(position),
                limit=settings.position_tolerance,
            )
        if abs(velocity) > settings.velocity_tolerance:
            raise RequestRejected(
                Reason.NOT_AT_REST,
                f'{name} moves at {velocity:.4g} rad/s, more than '
                f'{settings.velocity_tolerance:g} rad/s',
                joint=name,
                value=float(velocity),
                limit=settings.velocity_tolerance,
            )
