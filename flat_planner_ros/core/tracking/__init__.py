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

"""Tracking: state feedback around planned motions, its certificate, and starts in motion."""

from flat_planner_ros.core.tracking.arm_observer import ArmObserver, Estimate
from flat_planner_ros.core.tracking.certificate import Certificate, certify
from flat_planner_ros.core.tracking.moving_start import moving_start, MovingStart
from flat_planner_ros.core.tracking.settings import TrackerSettings, Uncertainty
from flat_planner_ros.core.tracking.tracked_motion import TrackedMotion
from flat_planner_ros.core.tracking.tracker import Phase, Tracker
from flat_planner_ros.core.tracking.tracker_stack import TrackerStack

__all__ = [
    'ArmObserver',
    'Certificate',
    'certify',
    'Estimate',
    'moving_start',
    'MovingStart',
    'Phase',
    'TrackedMotion',
    'Tracker',
    'TrackerSettings',
    'TrackerStack',
    'Uncertainty',
]
