"""A Ray cluster to work on: one that runs already, or one of this machine for as long as it is needed."""

import logging
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from dojo_env.errors import ConfigError, SimulationError

Task = TypeVar("Task")

LOCAL = "local"
_PATIENCE = 5.0
"""Seconds in which a cluster must answer."""

_SETTINGS = {
    "RAY_USAGE_STATS_ENABLED": "0",  # Nobody is told of our runs.
    "RAY_enable_worker_prestart": "0",  # No worker waits before it is needed.
    "RAY_prestart_worker_first_driver": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # What Ray will do by default; else it warns.
    "RAY_raylet_start_wait_time_s": "120",  # Of a local cluster on a busy machine.
    "RAY_agent_register_timeout_ms": "120000",
    "RAY_BACKEND_LOG_LEVEL": "fatal",  # Errors come as exceptions.
}
"""Ray reads them when it is imported."""


def set_environment(address: str) -> None:
    """Set what Ray reads when it is imported: to be called before that.

    Args:
        address: as for `open_cluster`.
    """
    os.environ |= _SETTINGS
    if address.startswith(("127.", "localhost")):
        # Else Ray looks at this machine's other address, where nobody answers.
        os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"


@contextmanager
def open_cluster(address: str, slots: int) -> Iterator[None]:
    """Connect to a cluster for as long as the context lasts.

    Args:
        address: HOST:PORT of a cluster's head, with a node of it on this machine; or `local`, which starts
            one that only this machine reaches, and ends it afterwards.
        slots: how much such a local one runs at once.

    Raises:
        ConfigError: Ray is not installed, or no cluster answers.
    """
    set_environment(address)
    try:
        import ray  # noqa: PLC0415 - optional
    except ImportError as error:
        raise ConfigError('Ray is not installed; pip install "traffic-dojo[distributed]"') from error
    settings: dict[str, Any] = {}
    if address == LOCAL:
        settings = {"num_cpus": slots, "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
    else:
        _check_answers(address)
    try:
        ray.init(
            address,
            log_to_driver=False,
            logging_level=logging.ERROR,
            **settings,
        )
    except Exception as error:  # Ray raises plain ones, too
        reason = str(error).strip().splitlines()[0]
        raise ConfigError(f"{address}: no Ray cluster to work on ({reason})") from error
    try:
        yield
    finally:
        ray.shutdown()


def collect_results(running: dict[Any, Task], name: Callable[[Task], str]) -> Iterator[tuple[Task, Any]]:
    """Wait for tasks, whichever ends first.

    Args:
        running: what each of Ray's references is for; emptied as they end.
        name: tells people which task it is.

    Yields:
        A task that has ended, and what it gave.

    Raises:
        SimulationError: a task has lost too many nodes. What a task itself raised is raised as it is.
    """
    import ray  # noqa: PLC0415 - optional

    while running:
        (done, *_), _ = ray.wait(list(running))
        task = running.pop(done)
        try:
            result = ray.get(done)
        except ray.exceptions.RayTaskError as error:
            raise error.cause from None
        except ray.exceptions.RayError as error:
            raise SimulationError(f"{name(task)}: {type(error).__name__}") from error
        yield task, result


def _check_answers(address: str) -> None:
    """See that somebody listens, which Ray itself finds out only after a minute."""
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=_PATIENCE).close()
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"{address}: no Ray cluster answers ({error}); expected HOST:PORT of one, or {LOCAL}"
        ) from error
