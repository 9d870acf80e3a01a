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
Motions that tell an arm's model, carried out through the planner: from a rough file to a good one.

The planner, the arm and, if there is one, the tracker run already. Return, Ctrl-C or SIGTERM end
it at any time: the arm is brought to rest.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
import sys
from threading import Event
from typing import TextIO

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.core.excitation import Excitation, ExcitationSettings, Heard, Proposal, Room
from flat_planner_ros.core.model_fit import fit_model
from flat_planner_ros.core.planning import JointLimits
from flat_planner_ros.core.session import SessionSettings
from flat_planner_ros.programs import INTERRUPTED
from flat_planner_ros.ros.nodes.node_runner import signals_caught
from flat_planner_ros.ros.parameters import planner as planner_parameters
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.programs.command_line import (
    explain_os,
    missing_for_plot,
    number_above_zero,
    parsed,
    split_arguments,
)
from flat_planner_ros.ros.programs.exciter import Aborted, ExcitationFailed, Exciter
from flat_planner_ros.ros.programs.fit_outputs import add_files, write_files
from flat_planner_ros.ros.programs.outputs import check_writable, summary_stream
from flat_planner_ros.ros.wire import interfaces
import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions

HIDDEN = ('offset', 'delay')
"""Parameters of which errors are not shown: they only have to be known with the others."""


def main(args: Sequence[str] | None = None) -> int:
    """
    Move the arm until its model is known.

    Returns
    -------
    int
        0 with every parameter as certain as wanted and a model that explains the motions, 1
        otherwise, 130 after an abort.

    """
    own, ros = split_arguments(sys.argv if args is None else args)
    options = parsed(_parser(), own, ['output', 'plot'])
    if missing := missing_for_plot(options.plot):
        print(f'excite: {missing}', file=sys.stderr)
        return 1
    try:
        check_writable(options.output, options.plot)
        settings = read_settings(
            options.params_file,
            planner_parameters.ROWS,
            planner_parameters.build,
            node=f'{options.namespace.strip("/")}/{interfaces.PLANNER}',
            warn=lambda text: print(f'excite: {text}', file=sys.stderr),
        ).session
        with signals_caught() as interrupted:
            rclpy.init(args=ros, signal_handler_options=SignalHandlerOptions.NO)
            return _run(settings, options, interrupted)
    except FlatPlannerError as error:
        print(f'excite: {error}', file=sys.stderr)
        return 1
    except OSError as error:
        print(f'excite: {explain_os(error)}', file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()


def _run(settings: SessionSettings, options: Namespace, interrupted: Event) -> int:
    """Carry the motions out, and write what they tell."""
    summary = summary_stream(options.output, options.plot)
    exciter = Exciter(settings, interrupted)
    try:
        excitation = _excite(exciter, settings, options, summary)
    except Aborted:
        print(f'aborted: {exciter.stop()}', file=sys.stderr)
        return INTERRUPTED
    except ExcitationFailed as error:
        print(f'excite: {error}; {exciter.stop()}', file=sys.stderr)
        return 1
    finally:
        exciter.destroy_node()
    seen = excitation.measurements
    fit = fit_model(seen, settings.arm, with_imbalance=True)
    print(fit.text, file=summary)
    write_files(options, settings.arm, seen, fit)
    return 0 if excitation.is_certain and not fit.misfit else 1


def _excite(
    exciter: Exciter, settings: SessionSettings, options: Namespace, summary: TextIO
) -> Excitation:
    """Carry motions out until the model is known, and say what each is for and tells."""
    exciter.wait_for_nodes()
    limits = settings.limits or JointLimits.of(settings.arm.n)
    room = Room.within(limits, exciter.pose(), options.range)
    joints = settings.joints[-2 - len(room.firsts) : -1]
    wanted = ExcitationSettings(
        accuracy=options.accuracy,
        noise=options.noise,
        first_share=options.first,
        most_motions=options.motions,
    )
    excitation = Excitation(settings.arm, settings.options, limits, room, wanted)
    for joint, (low, high), effort in zip(joints, room.ranges, room.efforts, strict=False):
        print(
            f'{joint} from {low:.3g} to {high:.3g} rad, with at most {effort:.3g} N m',
            file=summary,
        )
    if len(joints) < settings.arm.n - 1:
        print(
            'the joints before it are not moved, and tell nothing: they need finite limits.effort',
            file=summary,
        )
    print('Return or Ctrl-C brings the arm to rest and ends this', file=summary, flush=True)
    number = 0
    while not excitation.is_done:
        number += 1
        proposal = excitation.propose(exciter.pose())
        print(f'{number}: {_announced(proposal, joints)}', file=summary, flush=True)
        heard = excitation.hear(exciter.carry_out(proposal, excitation.record_time, room))
        print(f'   {_told(heard)}', file=summary, flush=True)
        print(_errors(proposal, heard), file=summary, flush=True)
    if excitation.untold:
        print(f'no motion tells {", ".join(excitation.untold)}', file=summary)
    return excitation


def _announced(proposal: Proposal, joints: Sequence[str]) -> str:
    """Return what a motion is, and what it is for."""
    wanted = proposal.candidate
    goals = wanted.final[-1 - len(joints) : -1].tolist()
    places = ', '.join(
        f'{joint} to {goal:.3f} rad' for joint, goal in zip(joints, goals, strict=True)
    )
    return (
        f'{places} in {wanted.duration:.2f} s, up to '
        f'{wanted.peak_effort:.3g} N m of {joints[-1]}, for {proposal.sought}'
    )


def _told(heard: Heard) -> str:
    """Return whether a motion went as predicted."""
    link, passive, *firsts = 100.0 * heard.misprediction
    verdict = 'the next may be larger' if heard.holds else 'the next is not larger'
    efforts = ''.join(f', {share:.2g} % of link {i}' for i, share in enumerate(firsts, 1))
    return (
        f'predicted to {link:.2g} % of link n-1, {passive:.2g} % of the passive joint{efforts}: '
        f'{verdict}'
    )


def _errors(proposal: Proposal, heard: Heard) -> str:
    """Return standard errors: before, as predicted for after, and as reached."""
    rows = zip(proposal.names, proposal.before, proposal.after, heard.reached, strict=True)
    return '\n'.join(
        f'   {name:<20} ± {_share(before)} before, {_share(after)} predicted, '
        f'{_share(reached)} reached'
        for name, before, after, reached in rows
        if name.partition('[')[0] not in HIDDEN
    )


def _share(error: float) -> str:
    """Return a relative error for people."""
    return f'{100.0 * error:.2g} %' if np.isfinite(error) and error < 1.0 else 'unknown'


def _parser() -> ArgumentParser:
    """Return the parser of the own arguments."""
    parser = ArgumentParser(
        prog='excite',
        usage='%(prog)s [-h] --params-file FILE [-o FILE] [options] [--ros-args ...]',
        description='Find the model of an arm by motions that are made for it: small ones first, '
        'larger ones once motions go as predicted, each for what is least certain. Joint n-1 '
        'moves first, then all joints if their efforts are limited. Planner and arm run already.',
        epilog='Another namespace: --namespace /arm1 --ros-args -r __ns:=/arm1',
    )
    add = parser.add_argument
    add_files(parser, 'parameter file of the planner: the model as believed, and limits.effort')
    add(
        '--accuracy',
        type=number_above_zero,
        default=ExcitationSettings.accuracy,
        help='standard error to reach, relative to each parameter',
    )
    add(
        '--noise',
        metavar='RAD',
        type=number_above_zero,
        default=ExcitationSettings.noise,
        help='noise of the encoders, until the motions have told it',
    )
    add(
        '--first',
        metavar='SHARE',
        type=number_above_zero,
        default=ExcitationSettings.first_share,
        help='share of effort limit and range that the first motion may use',
    )
    add(
        '--range',
        metavar='RAD',
        type=number_above_zero,
        default=1.5,
        help='how far each joint may turn from where it is, within its limits',
    )
    add('--motions', type=int, default=ExcitationSettings.most_motions, help='most motions')
    add('--namespace', default='', metavar='NS', help='of the nodes, for the parameter file')
    return parser


if __name__ == '__main__':
    sys.exit(main())
