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

"""From a rough parameter file to a good one: motions on the nodes, and how they are ended."""

import os
from pathlib import Path
import signal

from flat_planner_ros.ros.parameters import planner as planner_parameters
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.programs import excite
import numpy as np
import pytest
from ros.rig import Suite

ROUGH = """
/**:
  ros__parameters:
    joints: [joint1, joint2]
    model: {inertia_star: [6.4e-4, 3.3e-5], stiffness: 3.0e-3, damping: 2.0e-5}
/**/flat_planner:
  ros__parameters:
    limits: {effort: [0.015, .inf]}
"""
SCALES = {'inertia': 1.3, 'stiffness': 0.75, 'damping': 1.4}
FRICTION = {'friction.viscous': [2e-4], 'friction.coulomb': [5e-4]}
LONGER = Path(__file__).resolve().parents[3] / 'config' / 'arm_3dof.yaml'
PATIENCE = 200.0
"""Real time that all motions may take on a busy machine [s]."""


class Bench:
    """The nodes of an arm that is not what its file says, and the program."""

    def __init__(self, graph, tmp_path, *options, rough=ROUGH, speed=3.0, stdin=None, **plant):
        """Start them; the plant with what is given."""
        self.graph = graph
        self.rough, self.fitted = tmp_path / 'rough.yaml', tmp_path / 'arm.yaml'
        self.rough.write_text(rough, 'utf-8')
        mismatch = {f'mismatch.{name}_scale': scale for name, scale in SCALES.items()}
        plant |= {**mismatch, 'noise.position_std': 1e-5, 'publish_rate': 200.0}
        given = '--params-file', str(self.rough)
        self.suite = Suite(graph, None, plant, *given, speed=speed)
        files = '--params-file', str(self.rough), '-o', str(self.fitted)
        self.process = graph.start('excite', *files, *options, stdin=stdin)

    def wait(self):
        """Return the exit code, the nodes spinning meanwhile."""
        self.graph.expect(lambda: self.process.exit_code is not None, 'the end', PATIENCE)
        return self.process.exit_code


def test_a_rough_file_becomes_a_good_one(graph, tmp_path):
    bench = Bench(graph, tmp_path, '--accuracy', '0.02', **FRICTION)
    assert bench.wait() == 0, bench.process.stderr
    arm = read_settings(
        bench.fitted, planner_parameters.ROWS, planner_parameters.build, node='flat_planner'
    ).session.arm
    true = [
        SCALES['inertia'] * 6.4e-4,
        SCALES['inertia'] * 3.3e-5,
        SCALES['stiffness'] * 3e-3,
        SCALES['damping'] * 2e-5,
    ]
    assert [*arm.inertia_star, arm.stiffness, arm.damping] == pytest.approx(true, rel=0.06)
    # At the speeds of small motions viscous friction is a few hundredths of the effort, and joint
    # states that a busy machine loses count for more.
    friction = [arm.viscous_friction[-1], arm.coulomb_friction[-1]]
    assert friction == pytest.approx(np.ravel(list(FRICTION.values())), abs=1e-4)
    said = bench.process.stdout
    assert 'joint1 from -1.5 to 1.5 rad, with at most 0.015 N m' in said
    assert 'predicted,' in said
    assert 'the next is not larger' in said  # the first prediction rests on the rough file
    peaks = [max(abs(s.effort[0]) for s in bench.suite.states), 0.015]
    assert peaks[0] <= peaks[1]


@pytest.fixture
def terminal():
    """Return both ends of a terminal: that of whoever types, and that of the program."""
    ends = os.openpty()
    yield ends
    for end in ends:
        os.close(end)


@pytest.mark.parametrize(
    ('end', 'joints'),
    [(signal.SIGINT, 2), (signal.SIGTERM, 3), (b'\n', 2)],
    ids=['SIGINT', 'SIGTERM, three joints', 'Return'],
)
def test_an_abort_brings_the_arm_to_rest(graph, tmp_path, terminal, end, joints):
    keyboard, stdin = terminal
    rough = ROUGH if joints == 2 else LONGER.read_text('utf-8')
    bench = Bench(graph, tmp_path, rough=rough, speed=1.0, stdin=stdin)
    suite = bench.suite
    graph.expect(lambda: suite.verdicts('ACCEPTED'), 'a motion', PATIENCE)
    begin = float(suite.verdicts('ACCEPTED')[0]['start_time'])
    suite.wait_until(begin + 0.1)
    if isinstance(end, bytes):
        os.write(keyboard, end)
    else:
        os.kill(bench.process.pid, end)
    assert bench.wait() == excite.INTERRUPTED
    assert 'aborted: ' in bench.process.stderr
    graph.expect(lambda: suite.verdicts('STOPPED', 'FINISHED', 'FAILED'), 'the end of the motion')
    assert not suite.states[-1].effort[joints - 2]  # feedback holds those before it
    assert not bench.fitted.exists()


def test_what_cannot_be_tried_is_said(tmp_path, capsys):
    rough = tmp_path / 'rough.yaml'
    rough.write_text(ROUGH.replace('stiffness: 3.0e-3', 'stiffness: -1.0'), 'utf-8')
    assert excite.main(['excite', '--params-file', str(rough)]) == 1
    assert 'stiffness' in capsys.readouterr().err
