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

"""A private ROS graph for every test: real nodes, topics and services, and processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
import os
from pathlib import Path
import signal
import socket
import subprocess
import sys
import tempfile
from time import monotonic
from typing import Any

import flat_planner_ros
from flat_planner_ros.child_process import end_with_parent
import pytest

with suppress(ImportError):  # without ROS every test here is skipped (test/conftest.py)
    from rcl_interfaces.msg import Log
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from rclpy.parameter import Parameter
    from rclpy.parameter_client import AsyncParameterClient
    from rclpy.qos import DurabilityPolicy, QoSProfile

LINES_SHOWN = 12
"""Lines of the nodes that a failure shows."""

TIMEOUT = 60.0
"""Time in which anything must happen that happens at all [s]; on an idle machine it is 10 ms."""

DOMAINS = range(50, 100)
"""Domains of tests, above those that people choose by hand and below those without free ports."""

LOCK_PORT = 24100
"""First of the local TCP ports, one per domain, that keep a domain to one process of tests."""

POLL = 0.02
"""Longest wait between two looks at a condition [s]."""


class Process:
    """
    A node in a process of its own, killed at the end of the test if it still runs.

    Parameters
    ----------
    command
        The program and its arguments.
    environment
        Variables besides the test's own.
    stdin
        What it reads, a file's number; None for what the test reads.

    """

    def __init__(
        self, command: Sequence[str], environment: Mapping[str, str], stdin: int | None = None
    ) -> None:
        """Start it."""
        self._out = tempfile.TemporaryFile()  # noqa: SIM115  Closed by `close`.
        self._err = tempfile.TemporaryFile()  # noqa: SIM115
        self._popen = subprocess.Popen(
            command,
            env={**os.environ, **environment},
            stdin=stdin,
            stdout=self._out,
            stderr=self._err,
            start_new_session=True,
            preexec_fn=partial(end_with_parent, signal.SIGKILL),
        )

    @property
    def pid(self) -> int:
        """Return its process id."""
        return self._popen.pid

    @property
    def exit_code(self) -> int | None:
        """Return the exit code, None while it runs."""
        return self._popen.poll()

    @property
    def stdout(self) -> str:
        """Return what it has printed so far."""
        return _text(self._out)

    @property
    def stderr(self) -> str:
        """Return what it has complained about or logged so far."""
        return _text(self._err)

    def wait(self, timeout: float = TIMEOUT) -> int:
        """Return the exit code of a process that ends by itself."""
        return self._popen.wait(timeout)

    def stop(self, signal_number: int = signal.SIGINT, timeout: float = TIMEOUT) -> int:
        """Interrupt it and return its exit code."""
        self._popen.send_signal(signal_number)
        return self._popen.wait(timeout)

    def pause(self) -> None:
        """Stop it where it is, until `resume`."""
        self._popen.send_signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Let it go on."""
        self._popen.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        """End it at once, with whatever it has started."""
        with suppress(ProcessLookupError):
            os.killpg(self._popen.pid, signal.SIGKILL)
        self._popen.wait(TIMEOUT)

    def close(self) -> None:
        """Leave nothing behind."""
        self.kill()
        self._out.close()
        self._err.close()


class Graph:
    """
    A context of its own on a domain of its own, with an executor and a node that probes others.

    Attributes
    ----------
    context, executor, probe
        For nodes that a test makes itself, and the other side of every topic and service.
    log
        Everything that nodes have logged, as rcl_interfaces/Log.

    """

    def __init__(self, domain: int) -> None:
        """Open the graph."""
        self.domain = domain
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.executor = SingleThreadedExecutor(context=self.context)
        self._nodes: list[Node] = []
        self._processes: list[Process] = []
        self._publishers: dict[tuple[str, Any], Any] = {}
        self._clients: dict[str, Any] = {}
        self.probe = self.add(self._quiet_node('probe'))
        latched = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.log: list[Log] = self.collect(Log, '/rosout', latched, matched=False)

    def close(self) -> None:
        """Destroy everything, whatever state it is in."""
        try:
            self.executor.shutdown(0.0)
            for node in reversed(self._nodes):
                node.destroy_node()
            self.context.try_shutdown()
        finally:
            # Last: taking leave of a peer that has just been killed may crash the middleware.
            for process in self._processes:
                process.close()

    def add(self, node: Node) -> Node:
        """Spin a node with the others and destroy it at the end."""
        self._nodes.append(node)
        self.executor.add_node(node)
        return node

    def create(
        self,
        node_class: Callable[..., Node],
        parameters: Mapping[str, Any] | None = None,
        *arguments: str,
        **options: Any,
    ) -> Node:
        """
        Make one of our nodes and spin it.

        Parameters
        ----------
        node_class
            Its class.
        parameters : Mapping[str, Any]
            Values by name, as if from a parameter file.
        arguments
            What would follow `--ros-args`, e.g. '-r', 'joint_states:=other'.
        options
            As for `rclpy.node.Node`.

        """
        node = node_class(
            context=self.context,
            parameter_overrides=_parameters(parameters or {}),
            cli_args=['--ros-args', *arguments] if arguments else None,
            use_global_arguments=False,
            **options,
        )
        return self.add(node)

    def remove(self, node: Node) -> None:
        """Destroy a node in the middle of a test."""
        self.executor.remove_node(node)
        self._nodes.remove(node)
        node.destroy_node()

    def start(
        self, module: str, *arguments: str, stdin: int | None = None, **environment: str
    ) -> Process:
        """Start a module of our ROS layer, e.g. 'plant_node', as a process on the same graph."""
        wing = 'nodes' if module.endswith('_node') else 'programs'
        name = f'flat_planner_ros.ros.{wing}.{module}'
        return self.run([sys.executable, '-m', name, *arguments], stdin, **environment)

    def run(self, command: Sequence[str], stdin: int | None = None, **environment: str) -> Process:
        """Start any program on the same graph; it finds the code under test first."""
        paths = [str(Path(flat_planner_ros.__file__).parents[1])]
        paths += filter(None, [os.environ.get('PYTHONPATH')])
        own = {'PYTHONPATH': os.pathsep.join(paths), 'ROS_DOMAIN_ID': str(self.domain)}
        process = Process(command, {**own, **environment}, stdin)
        self._processes.append(process)
        return process

    def spin_until(self, condition: Callable[[], object], timeout: float = TIMEOUT) -> bool:
        """Serve all nodes until a condition holds; return whether it did before the deadline."""
        deadline = monotonic() + timeout
        while not condition():
            left = deadline - monotonic()
            if left <= 0.0:
                return False
            self.executor.spin_once(timeout_sec=min(left, POLL))
        return True

    def expect(self, condition: Callable[[], object], what: str, timeout: float = TIMEOUT) -> None:
        """Fail with a message unless a condition comes to hold before the deadline."""
        if not self.spin_until(condition, timeout):
            said = ''.join(f'\n{entry.name}: {entry.msg}' for entry in self.log[-LINES_SHOWN:])
            pytest.fail(f'not within {timeout:g} s: {what}; last heard:{said}')

    def collect(
        self,
        message_type: type,
        topic: str,
        qos: Any = 1000,
        *,
        matched: bool = True,
        raw: bool = False,
    ) -> list[Any]:
        """
        Return a list that grows with every message; wait for a publisher unless told not to.

        It grows by bytes if they are wanted `raw`: long motions take seconds to become objects.
        """
        messages: list[Any] = []
        subscription = self.probe.create_subscription(
            message_type, topic, messages.append, qos, raw=raw
        )
        if matched:
            self.expect(subscription.get_publisher_count, f'a publisher of {topic}')
        return messages

    def publish(self, topic: str, message: Any, qos: Any = 10, *, readers: int = 1) -> None:
        """Publish once as many as `readers` nodes listen."""
        key = topic, type(message)
        if key not in self._publishers:
            self._publishers[key] = self.probe.create_publisher(type(message), topic, qos)
        publisher = self._publishers[key]
        self.expect(
            lambda: publisher.get_subscription_count() >= readers, f'{readers} readers of {topic}'
        )
        publisher.publish(message)

    def call(self, service_type: Any, name: str, request: Any = None) -> Any:
        """Return the response of a service."""
        if name not in self._clients:
            self._clients[name] = self.probe.create_client(service_type, name)
        client = self._clients[name]
        self.expect(client.service_is_ready, f'the service {name}')
        return self._result(client.call_async(request or service_type.Request()), name)

    def set_parameters(self, node: str, **values: Any) -> list[Any]:
        """
        Set parameters of a node by its name as `ros2 param set` does, each by itself.

        Returns
        -------
        list
            One rcl_interfaces/SetParametersResult per parameter. For names with dots write
            `**{'noise.seed': 1}`.

        """
        client = self._parameter_client(node)
        return self._result(client.set_parameters(_parameters(values)), node).results

    def get_parameters(self, node: str, *names: str) -> list[Any]:
        """Return the values of parameters of a node by its name."""
        values = self._result(self._parameter_client(node).get_parameters(list(names)), node)
        return [rclpy.parameter.parameter_value_to_python(value) for value in values.values]

    def logged(self, text: str) -> list[str]:
        """Return what has been logged with a text in it."""
        return [entry.msg for entry in self.log if text in entry.msg]

    def _parameter_client(self, node: str) -> AsyncParameterClient:
        """Return the client of a node's parameter services once they are there."""
        if node not in self._clients:
            self._clients[node] = AsyncParameterClient(self.probe, node)
        client = self._clients[node]
        self.expect(client.services_are_ready, f'the parameter services of {node}')
        return client

    def _result(self, future: Any, what: str) -> Any:
        """Return what a call gave."""
        self.expect(future.done, f'an answer of {what}')
        return future.result()

    def _quiet_node(self, name: str) -> Node:
        """Return a node that offers nothing itself."""
        return rclpy.create_node(
            name,
            context=self.context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )


@contextmanager
def free_domain() -> Iterator[int]:
    """Lend a domain that no other process of tests on this machine uses."""
    first = os.getpid() % len(DOMAINS)
    taken = os.environ.get('ROS_DOMAIN_ID', '')
    with socket.socket() as lock:
        for domain in (*DOMAINS[first:], *DOMAINS[:first]):
            with suppress(OSError):
                if str(domain) != taken:
                    lock.bind(('127.0.0.1', LOCK_PORT + domain))
                    break
        else:
            pytest.fail(f'all domains from {DOMAINS[0]} to {DOMAINS[-1]} are in use')
        yield domain


@pytest.fixture(scope='session')
def ros_domain() -> Iterator[int]:
    """Return the domain of this process of tests."""
    with free_domain() as domain:
        yield domain


@pytest.fixture
def graph(ros_domain: int) -> Iterator[Graph]:
    """Return an empty graph, taken down after the test."""
    graph = Graph(ros_domain)
    try:
        yield graph
    finally:
        graph.close()


def _parameters(values: Mapping[str, Any]) -> list[Parameter]:
    """Return values by name as parameters."""
    return [Parameter(name, value=value) for name, value in values.items()]


def _text(file: Any) -> str:
    """Return the whole content of an open file that another process writes."""
    return os.pread(file.fileno(), os.fstat(file.fileno()).st_size, 0).decode(errors='replace')
