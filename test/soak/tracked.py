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

"""The soak test's tracked arm: wrong models, pushes, trackers killed, stopped and doubled."""

from __future__ import annotations

import os
import signal
from time import monotonic

import numpy as np
from ros.conftest import Graph
from ros.tracked_arm import ELDER, Tracked
from soak.rig import Endurance
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

PLANT = {'publish_rate': 500.0, 'real_time_factor': 0.25, 'input_timeout': 0.1}
TRACKER = {'rate': 500.0, 'timeout': 0.2, 'max_age': 0.1}
"""Twice the rate of the tests, at half their speed: there is time here."""

LIMIT = 0.05
"""Largest effort that the tracker may send [N m]."""

BAND, SETTLED = 5e-3, 1.0
"""Swing and error [rad] below which an arm must be so long after its motion [s]."""

LET_GO = 0.3
"""Time in which the plant's effort must be zero after the last one was sent [s]: input_timeout."""

FROZEN = 0.5
"""Time for which a tracker is stopped [s]; its timeout is shorter."""

REMEMBERED = 3.0
"""Real time for which a tracker counts as alive after its last word [s]."""

KINDS = (
    *('plain', 'wrong model', 'push', 'release', 'doubled'),
    *('SIGINT', 'SIGTERM', 'SIGKILL', 'SIGSTOP'),
)
"""What may happen to a motion."""


class TrackedSoak(Endurance, Tracked):
    """
    A tracked arm and what is done to it.

    Parameters
    ----------
    graph
        A graph of its own.
    seed
        Of all that is random.

    """

    kinds = KINDS

    def __init__(self, graph: Graph, seed: int) -> None:
        """Start the nodes."""
        self.trackers = []
        super().__init__(graph, seed, **PLANT)
        self.watch('plant_node', self.plant)

    def start_tracker(self, **given) -> None:
        """Start a tracker with a limit."""
        super().start_tracker(**{**TRACKER, 'limits.effort': f'[{LIMIT}]', **given})
        self.watch('tracker_node', self.tracker)
        self.trackers.append(self.tracker)

    def _start_afresh(self) -> None:
        """Leave one tracker, a new one, whatever an episode that failed has left."""
        for tracker in (*self.trackers, self.tracker):
            tracker.kill()
        self.start_tracker()

    def _episode(self, kind: str) -> None:
        """Move once, with whatever happens, and once more, as if nothing had."""
        self.counts['episodes'] += 1
        self._begin(kind)
        self._move()
        if kind in ('plain', 'wrong model', 'push'):
            self._see_it_settle(kind)
            return
        self.wait_until(self.begin + float(self.random.uniform(0.2, 0.9)))
        {
            'release': self._release,
            'doubled': self._double,
            'SIGINT': lambda: self._end(signal.SIGINT),
            'SIGTERM': lambda: self._end(signal.SIGTERM),
            'SIGKILL': lambda: self._end(signal.SIGKILL),
            'SIGSTOP': self._freeze,
        }[kind]()
        self._check_efforts()
        self._begin('plain')
        self._move()
        self._see_it_settle('plain')

    def _begin(self, kind: str) -> None:
        """Bring the arm back to rest, with the model that the episode wants."""
        self.graph.call(Trigger, '/flat_tracker/release')
        self.await_silence()
        share = self.random.uniform(-1.0, 1.0, 3) if kind == 'wrong model' else np.zeros(3)
        results = self.graph.set_parameters(
            'flat_plant',
            **{
                'mismatch.stiffness_scale': 1.0 + 0.25 * float(share[0]),
                'mismatch.damping_scale': 1.0 + 0.25 * float(share[1]),
                'mismatch.inertia_scale': 1.0 + 0.1 * float(share[2]),
            },
        )
        assert all(result.successful for result in results), results
        self.graph.call(Trigger, '/flat_plant/reset')
        self.pass_time(0.5)
        del self.sent[:], self.status[:], self.states[:-1], self.graph.log[:]

    def _move(self) -> None:
        """Move to a random pose."""
        self.goal = float(self.random.uniform(0.3, 3.0) * self.random.choice([-1.0, 1.0]))
        self.move(self.goal)
        self.counts['motions'] += 1

    def _see_it_settle(self, kind: str) -> None:
        """Look at what is left of the motion, and of a push after it."""
        since = self.end
        if kind == 'push':
            self.wait_until(self.end + 0.1)
            push = float(self.random.uniform(-0.02, 0.02))
            self.graph.publish('/flat_plant/push', Float64MultiArray(data=[push, 0.0]))
            since = self.end + 0.3
            self.counts['pushes'] += 1
        self.wait_until(since + SETTLED + 0.3)
        self._check_efforts()
        if self._is_late():
            self.counts['motions late, said by the tracker'] += 1
            return
        self.counts['ends checked'] += 1
        worst = self.errors(since + SETTLED, self.goal).max()
        assert worst < BAND, f'{worst:.4f} rad off, {SETTLED:g} s after the end'

    def _release(self) -> None:
        """Let the arm go in its motion."""
        self.graph.call(Trigger, '/flat_tracker/release')
        self._await_nothing()

    def _end(self, number: int) -> None:
        """End the tracker in its motion, and start another one: nothing moves by itself."""
        del self.processes['tracker_node']
        if number == signal.SIGKILL:
            self.tracker.kill()
        else:
            code = self.tracker.stop(number)
            assert code == 0, f'exit code {code}: {self.tracker.stderr[-2000:]}'
        self._await_nothing()
        self.graph.call(Trigger, '/flat_plant/reset')
        self.start_tracker()
        count, since = len(self.sent), len(self.states)
        self.pass_time(0.5)
        assert len(self.sent) == count, 'a restarted tracker sends efforts'
        moved = np.ptp([state.position[0] for state in self.states[since:]])
        assert moved < 1e-3, f'the arm has moved by {moved:.4f} rad after the restart'

    def _freeze(self) -> None:
        """Stop the tracker for a while: it gives up, says so once, and idles."""
        os.kill(self.tracker.pid, signal.SIGSTOP)
        try:
            self.pass_time(FROZEN)
            self._assert_no_effort()
        finally:
            os.kill(self.tracker.pid, signal.SIGCONT)
        self.graph.expect(lambda: self.graph.logged('given up'), 'an error')
        self._await_nothing()
        said = self.graph.logged('given up')
        assert len(said) == 1, said

    def _double(self) -> None:
        """Start a second tracker, which keeps silent; then it has the arm alone."""
        elder = self.tracker
        self.start_tracker()
        self.wait_until(self.end + 0.5)
        self.move_until_rivals_meet(0.0, 0.5, 0.0, 0.5)
        said = self.graph.logged(ELDER)
        assert len(said) == 1, said
        self.wait_until(self.end + SETTLED)
        said = self.graph.logged('another node sends efforts')
        assert not said, said
        elder.kill()
        self.graph.expect(lambda: not self.states[-1].effort[0], 'motors that are off')
        off = monotonic()
        # By then the other one knows that it is alone.
        self.graph.spin_until(lambda: monotonic() > off + REMEMBERED + 1.0)

    def _await_nothing(self) -> None:
        """Wait for the end of the efforts, and see that the motors are off."""
        self.await_silence()
        self.pass_time(LET_GO)
        self._assert_no_effort()

    def _assert_no_effort(self) -> None:
        """Check that nothing moves the arm."""
        effort = self.states[-1].effort[0]
        assert not effort, f'effort {effort} N m'

    def _check_efforts(self) -> None:
        """Check that no effort was out of bounds."""
        sent = np.array([effort.data[0] for effort in self.sent])
        self.counts['efforts checked'] += len(sent)
        assert np.isfinite(sent).all(), 'an effort is not finite'
        assert (np.abs(sent) <= LIMIT).all(), f'an effort of {np.abs(sent).max()} N m'
        self._look()

    def _is_late(self) -> bool:
        """Return whether the tracker gave up for late joint states; nothing else excuses."""
        said = self.graph.logged('given up')
        late = [text for text in said if 'joint sample' in text or 'joint states' in text]
        assert len(said) == len(late), said
        return bool(late)
