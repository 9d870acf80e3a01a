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

"""Rows of a study: what they say is what the planner and the plant say of each case alone."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

from core.study.some_study import ARM, case, Cases, rows_of, study
from flat_planner_ros.core.arm import Drive, PlanarArm
from flat_planner_ros.core.planning import JointLimits, Strategy
from flat_planner_ros.core.plant import DriveSettings
from flat_planner_ros.core.study import (
    ACCEPTED,
    answer,
    Batch,
    chunks_of,
    EngineBroken,
    here,
    on_executor,
    PlantDisagrees,
    playing,
)
from flat_planner_ros.core.study import study as rows
from flat_planner_ros.core.study.planned import figures
from flat_planner_ros.core.study.playing import ends_of, motions_of, residuals
from flat_planner_ros.core.study.study import commands_of
from flat_planner_ros.core.tracking import TrackerSettings
import numpy as np
import pytest


def table_of(chosen):
    """Return all rows that this process makes."""
    return rows_of(here(chosen, chunks_of(0, chosen.count, chosen.chunk)))


@pytest.fixture(scope='module')
def whole():
    """Return the study's table, made in this process."""
    return table_of(study())


def numbers(table, title):
    """Return a column as numbers."""
    return np.array([float(value) for value in table[title]])


def test_what_is_predicted_is_what_is_simulated(whole):
    predicted, simulated = numbers(whole, 'residual'), numbers(whole, 'simulated_residual')
    assert simulated.max() > 0.1
    by_effort = np.array(whole['drive']) == "'effort'"
    # In arrays the effort is foreseen as it is planned, and played as samples of 5 ms.
    assert simulated[by_effort] == pytest.approx(predicted[by_effort], rel=5e-4, abs=1e-6)
    singly = by_effort & (np.array(whole['strategy']) == "'insensitive'")
    assert simulated[singly] == pytest.approx(predicted[singly], rel=1e-6, abs=1e-9)
    # A servo follows points that are joined by cubics; the prediction is that of smooth motion.
    assert simulated == pytest.approx(predicted, rel=1e-2, abs=1e-5)
    miss, foreseen = numbers(whole, 'simulated_miss'), numbers(whole, 'miss')
    assert foreseen[by_effort].max() > 1e-2
    # What the samples of the strategies that are planned in arrays leave is not foreseen.
    assert miss == pytest.approx(foreseen, abs=2e-5)


def test_the_worst_is_that_of_the_box_and_insensitive_is_better(whole):
    worst, names = numbers(whole, 'worst_residual'), np.array(whole['strategy'])
    medians = {name: np.median(worst[names == name]) for name in set(names)}
    assert medians["'insensitive'"] < 0.5 * medians["'min_control_effort'"]
    inside = numbers(whole, 'payload') < 1e-2
    assert (numbers(whole, 'simulated_residual') <= 1.01 * worst + 1e-5)[inside].all()


def test_a_row_alone_is_the_row_of_the_table(whole):
    chosen = study()
    for number in (0, 13, 59):
        alone = {title: repr(values.tolist()[0]) for title, values in chosen.row(number).items()}
        assert alone == {title: values[number] for title, values in whole.items()}


def test_threads_make_the_same_table(whole):
    chosen = study()
    made = on_executor(chosen, chunks_of(0, chosen.count, 8), lambda: ThreadPoolExecutor(3), 3)
    assert rows_of(made) == whole


def test_a_killed_worker_changes_nothing(whole, tmp_path):
    def executor():
        return ProcessPoolExecutor(2, mp_context=get_context('spawn'))

    chosen = study(Cases(fatal=1.1, marks=str(tmp_path)))
    made = rows_of(on_executor(chosen, chunks_of(0, chosen.count, 8), executor, 2))
    assert (tmp_path / 'died').exists()
    assert made == whole


def exit_at_once(first, stop):
    """Kill the process that does this."""
    import os
    import signal

    os.kill(os.getpid(), signal.SIGKILL)


def test_workers_that_always_die_are_told_with_the_rows():
    def executor():
        return ProcessPoolExecutor(1, mp_context=get_context('fork'))

    with pytest.raises(EngineBroken, match='before the rows 0 to 3 were done'):
        list(on_executor(exit_at_once, chunks_of(0, 8, 4), executor, 1))


def test_few_chunks_are_under_way_at_a_time():
    asked = []

    def chunks():
        for chunk in chunks_of(0, 100, 1):
            asked.append(chunk)
            yield chunk

    made = on_executor(lambda first, stop: first, chunks(), lambda: ThreadPoolExecutor(2), 2)
    for number in range(50):
        assert next(made)[1] == number
    assert len(asked) <= 50 + 6
    made.close()


def test_what_is_planned_in_arrays_is_what_the_planner_says_of_each(whole):
    chosen = study()
    for number in range(0, 40, 3):  # polynomial and min_control_effort
        alone = chosen.case(number)
        said = answer(alone)
        found = figures(alone, said.motion)
        row = {title: values[number] for title, values in whole.items()}
        numbers = {
            title: float(row[title])
            for title in row
            if title not in ('strategy', 'drive') and title != 'verdict'
        }
        assert row['verdict'] == repr(said.verdict)
        assert numbers['planned_duration'] == found.duration
        assert numbers['rms_effort'] == pytest.approx(found.rms_effort[0], rel=1e-9)
        assert numbers['peak_effort'] == pytest.approx(found.peak_effort[0], rel=2e-3)
        # Samples of 5 ms joined linearly, for the planner; as good as continuous, in arrays.
        assert numbers['residual'] == pytest.approx(found.residual, rel=5e-4, abs=1e-6)
        assert numbers['worst_residual'] == pytest.approx(found.worst_residual, rel=5e-4)
        assert numbers['miss'] == pytest.approx(found.miss, abs=2e-5)
        motions, commands = motions_of([alone]), commands_of([said.motion.samples])
        ends = ends_of(motions, commands, [True])
        left = residuals(motions, ends)[0]
        assert numbers['simulated_residual'] == pytest.approx(left, rel=1e-7, abs=1e-10)


def one_row(template, checked=True, **more):
    """Return the table of one case."""
    count = len(template.start)
    batch = Batch(
        template=template,
        places=np.array([0]),
        starts=np.zeros((1, count)),
        finals=np.array([template.final]),
        durations=np.array([template.duration]),
        **more,
    )
    made = rows._Rows(replace(study(), joints=template.settings.joints), 1, np.array([checked]))
    made.take(batch)
    return {title: values.tolist()[0] for title, values in made.table.items()}


def test_a_refusal_is_a_row_with_its_reason():
    limits = JointLimits.of(2, effort=np.array([0.005, np.inf]))
    template = case()
    template = replace(template, settings=replace(template.settings, limits=limits))
    row = one_row(template)
    assert row['verdict'] == 'EFFORT_LIMIT'
    assert np.isnan([row['planned_duration'], row['peak_effort'], row['simulated_residual']]).all()
    assert 'shortest feasible duration' in answer(template).message
    free = one_row(replace(template, duration=0.0))
    assert free['verdict'] == ACCEPTED
    assert free['peak_effort'] == pytest.approx(0.005, rel=1e-3)
    broken = one_row(case(), true=np.array([[6.4e-4, 3.3e-5, -1.0, 2e-5]]))
    assert broken['verdict'] == 'InvalidModel'


@pytest.mark.parametrize(
    'more',
    [
        {'drives': DriveSettings(saturation=(0.008,))},
        {'true': replace(ARM, coulomb_friction=np.array([5e-4]))},
    ],
)
def test_what_is_not_linear_is_integrated_and_checked(more):
    row, plain = one_row(case(**more)), one_row(case())
    assert row['verdict'] == ACCEPTED
    assert plain['simulated_residual'] < 1e-5
    assert row['simulated_miss'] > 100.0 * plain['simulated_miss']


def test_feedback_is_left_to_the_plant():
    true = ARM.scaled(stiffness=1.2)
    by_itself = one_row(case(true=true))
    held = one_row(case(true=true, drives=DriveSettings(feedback_p=(0.05,), feedback_d=(0.01,))))
    assert held['residual'] == by_itself['residual']
    assert held['simulated_residual'] < 0.95 * by_itself['simulated_residual']


def test_a_longer_arm_is_integrated_and_checked():
    link = {'link_length': [0.2], 'link_com': [0.1], 'link_mass': [0.3], 'link_inertia': [1e-3]}
    arm = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5, **link)
    template = case(arm=arm, start=(0.0,) * 3, final=(0.5, 1.0, 0.0))
    row = one_row(template)
    assert row['verdict'] == ACCEPTED
    assert row['simulated_residual'] < 1e-4
    assert row['peak_effort.joint1'] > row['peak_effort.joint2'] > 0.0
    soft = one_row(replace(template, true=arm.scaled(stiffness=0.8)))
    assert soft['simulated_residual'] == pytest.approx(soft['residual'], rel=1e-4)


def test_the_plant_that_disagrees_stops_the_study(monkeypatch):
    monkeypatch.setattr(playing, 'AGREEMENT', 1e-14)
    with pytest.raises(PlantDisagrees, match=r'rad from what exact or common steps found') as told:
        one_row(case(true=ARM.scaled(stiffness=1.1)))
    assert told.value.difference > told.value.allowed
    one_row(case(true=ARM.scaled(stiffness=1.1)), checked=False)


def test_a_tracker_leaves_less():
    true = ARM.scaled(stiffness=1.25, damping=1.25)
    open_loop = one_row(case(Strategy.MIN_CONTROL_EFFORT, true=true))
    tracked = one_row(case(Strategy.MIN_CONTROL_EFFORT, true=true, tracker=TrackerSettings()))
    assert tracked['residual'] == open_loop['residual'] > 0.1
    assert tracked['simulated_residual'] < 0.3 * open_loop['simulated_residual']
    servo = one_row(case(drive=Drive.POSITION, tracker=TrackerSettings()))
    assert servo['verdict'] == 'InvalidStudy'
