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

"""A study as it is made without ROS; its parts can be told to other processes."""

from dataclasses import dataclass
from math import pi
import os
from pathlib import Path
import signal

from flat_planner_ros.core.arm import Drive, PlanarArm
from flat_planner_ros.core.insensitive import Insensitivity, UncertaintyBox
from flat_planner_ros.core.planning import PlanningOptions, Strategy
from flat_planner_ros.core.plant import DriveSettings
from flat_planner_ros.core.session import SessionSettings
from flat_planner_ros.core.study import (
    Axes,
    Batch,
    Case,
    Distribution,
    Draws,
    last_links_of,
    Study,
    Turns,
)
import numpy as np

ARM = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
JOINTS = ('joint1', 'joint2')
STRATEGIES = (Strategy.POLYNOMIAL, Strategy.MIN_CONTROL_EFFORT, Strategy.INSENSITIVE)


def case(strategy=Strategy.POLYNOMIAL, drive=Drive.EFFORT, arm=ARM, **more):
    """Return a motion of half a turn in a second."""
    box = UncertaintyBox(stiffness=0.25, damping=0.25)
    options = PlanningOptions(strategy=strategy, drive=drive, insensitivity=Insensitivity(box=box))
    given = {
        'settings': SessionSettings(
            joints=tuple(f'joint{i + 1}' for i in range(arm.n)), arm=arm, options=options
        ),
        'true': arm,
        'start': (0.0, 0.0),
        'final': (pi, 0.0),
        'duration': 1.0,
        'drives': DriveSettings(drive=drive),
    }
    return Case(**{**given, **more})


@dataclass(frozen=True)
class Cases:
    """
    Makes cases of `strategy`, `drive`, `duration`, `stiffness`, `damping` and `payload`.

    The first process that comes upon a stiffness beyond `fatal` dies.
    """

    fatal: float = 0.0
    marks: str = ''

    def __call__(self, columns):
        """Return a batch for each strategy and drive."""
        self._die(columns)
        found = []
        keys = list(zip(columns['strategy'], columns['drive'], strict=True))
        for key in dict.fromkeys(keys):
            places = np.array([place for place, other in enumerate(keys) if other == key])
            template = case(Strategy(key[0]), Drive(key[1]))
            count = len(places)
            true = np.tile(last_links_of(ARM), (count, 1))
            true[:, 2] *= columns['stiffness'][places]
            true[:, 3] *= columns['damping'][places]
            true[:, :2] += (columns['payload'][places] * ARM.inertia_star.last)[:, None]
            found.append(
                Batch(
                    template=template,
                    places=places,
                    starts=np.zeros((count, 2)),
                    finals=np.tile(template.final, (count, 1)),
                    durations=np.array(columns['duration'][places]),
                    true=true,
                )
            )
        return found

    def _die(self, columns):
        """Kill the process where that is asked for and has not happened yet."""
        if self.fatal > 0.0 and columns['stiffness'].max() > self.fatal:
            mark = Path(self.marks) / 'died'
            if not mark.exists():
                mark.touch()
                os.kill(os.getpid(), signal.SIGKILL)


def study(cases=None, repeats=10, **more):
    """Return a study of strategies and drives on random arms."""
    axes = Axes(
        turns=(
            Turns(names=('strategy',), values=tuple((s.value,) for s in STRATEGIES)),
            Turns(names=('drive',), values=tuple((d.value,) for d in Drive)),
        ),
        draws=tuple(
            Draws(name=name, distribution=Distribution.UNIFORM, spread=limits)
            for name, limits in {
                'duration': (0.8, 1.3),
                'stiffness': (0.75, 1.25),
                'damping': (0.75, 1.25),
                'payload': (0.0, 0.3),
            }.items()
        ),
        repeats=repeats,
        seed=3,
    )
    return Study(axes=axes, cases=cases or Cases(), joints=JOINTS, **{'chunk': 8, **more})


def rows_of(chunks):
    """Return a table of chunks' tables, as texts to the last digit."""
    tables = [table for _, table in chunks]
    return {
        title: [repr(value) for table in tables for value in table[title].tolist()]
        for title in tables[0]
    }
