"""The paper's experiment as its users run it: one command, three nodes, a table."""

import csv
import signal

from flat_planner_ros.paper_example import PRINTED
from flat_planner_ros.ros.planner_node import PlannerNode
import pytest

EXPECTED = {
    ('1', 'polynomial'): (0.008246, 0.0),
    ('1', 'min_control_effort'): (0.007406, 0.0),
    ('1', 'min_potential_energy'): (0.008692, 0.0),
    ('2', 'polynomial'): (0.008297, 0.00449),
    ('2', 'min_control_effort'): (0.007444, 0.00358),
    ('2', 'min_potential_energy'): (0.008761, 0.00299),
    ('3', 'polynomial'): (0.008297, 0.0980),
    ('3', 'min_control_effort'): (0.007444, 0.0758),
    ('3', 'min_potential_energy'): (0.008761, 0.0609),
}
"""RMS effort [N m] and amplitude [rad] by an independent integration (docs/paper_errata.md)."""

EXPERIMENT_TIMEOUT = 110.0
"""Nine motions at several times real time take about 20 s on two free cores [s]."""


@pytest.mark.timeout(150)
def test_the_whole_experiment_gives_the_verified_numbers(graph, tmp_path):
    table, figure = tmp_path / 'table.csv', tmp_path / 'figures.png'
    process = graph.start('paper_table', '--csv', str(table), '--plot', str(figure))
    assert process.wait(EXPERIMENT_TIMEOUT) == 0, process.stderr
    with table.open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    assert [(row['scenario'], row['strategy']) for row in rows] == list(EXPECTED)
    for row in rows:
        rms, amplitude = EXPECTED[row['scenario'], row['strategy']]
        printed = PRINTED[int(row['scenario']), row['strategy']]
        assert float(row['rms_effort']) == pytest.approx(rms, rel=5e-3)
        assert float(row['amplitude']) == pytest.approx(amplitude, rel=0.02, abs=2e-5)
        assert (float(row['paper_rms_effort']), float(row['paper_amplitude'])) == printed
    assert figure.read_bytes().startswith(b'\x89PNG')
    for _, strategy in EXPECTED:
        assert process.stdout.count(strategy) == 3


def test_it_does_not_mix_with_nodes_that_already_run(graph):
    graph.create(PlannerNode)
    process = graph.start('paper_table')
    graph.expect(lambda: process.exit_code is not None, 'the end', timeout=20.0)
    assert process.exit_code == 1
    assert 'flat_planner already runs here' in process.stderr


def test_an_interrupt_leaves_no_node_behind(graph):
    process = graph.start('paper_table')
    ours = {'flat_planner', 'flat_plant', 'flat_monitor'}

    def present() -> set[str]:
        return ours & set(graph.probe.get_node_names())

    graph.expect(lambda: present() == ours, 'the three nodes', timeout=30.0)
    process.stop(signal.SIGINT)
    assert process.exit_code == 130
    assert 'Traceback' not in process.stderr
    graph.expect(lambda: not present(), 'the end of the three nodes', timeout=30.0)


def test_a_wrong_option_is_explained(graph):
    process = graph.start('paper_table', '--polt', 'x.png')
    assert process.wait() == 2
    assert 'usage' in process.stderr
