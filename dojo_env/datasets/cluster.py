"""Parts made on a Ray cluster, whose nodes need share no disk: what a node has made comes back as bytes."""

import logging
import os
import socket
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from dojo_env.datasets.parts import make_part
from dojo_env.datasets.settings import DatasetSettings, Job
from dojo_env.datasets.workers import Worker
from dojo_env.errors import ConfigError, SimulationError
from dojo_maps.whole_file import replaced_folder

LOCAL = "local"
_PATIENCE = 5.0
"""Seconds in which a cluster must answer."""
_RETRIES = 5
"""How many lost nodes a part survives."""
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


def run_on_cluster(
    settings: DatasetSettings, jobs: Sequence[Job], parts: Path, address: str, count: int
) -> Iterator[Job]:
    """Make parts on a cluster's nodes; yields each episode when its part is written here.

    Args:
        settings: of the data set; scenarios and cameras are packaged names, or paths that all nodes have.
        jobs: the episodes.
        parts: where their parts go.
        address: HOST:PORT of a cluster's head, with a node of it on this machine; or `local`, which starts
            one that only this machine reaches, and ends it afterwards.
        count: parts made at once by a local one.

    Raises:
        ConfigError: Ray is not installed, or no cluster answers.
        SimulationError: a part has lost too many nodes.
    """
    with _open_cluster(address, count):
        import ray  # noqa: PLC0415 - optional

        remote = ray.remote(num_cpus=1, max_retries=_RETRIES, scheduling_strategy="SPREAD")(_make_on_node)
        running = {remote.remote(settings, job): job for job in jobs}
        while running:
            (done, *_), _ = ray.wait(list(running))
            job = running.pop(done)
            try:
                files = ray.get(done)
            except ray.exceptions.RayTaskError as error:
                raise error.cause from None
            except ray.exceptions.RayError as error:
                raise SimulationError(f"episode {job.number}: {type(error).__name__}") from error
            with replaced_folder(parts / job.name) as folder:
                _write_files(files, folder)
            yield job


def _make_on_node(settings: DatasetSettings, job: Job) -> dict[str, bytes]:
    """Make a part; Ray's own processes have threads that no fork survives, so one of ours does."""
    with TemporaryDirectory() as folder:
        worker = _node_worker()
        worker.begin((make_part, (settings, job, Path(folder))))
        worker.end()
        return {
            str(path.relative_to(folder)): path.read_bytes()
            for path in Path(folder).rglob("*")
            if path.is_file()
        }


@cache
def _node_worker() -> Worker:
    """Start a process that lives as long as Ray's own."""
    return Worker()


def _write_files(files: Mapping[str, bytes], folder: Path) -> None:
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


@contextmanager
def _open_cluster(address: str, count: int) -> Iterator[None]:
    """Connect to a cluster for as long as the context lasts."""
    os.environ |= _SETTINGS
    more: dict[str, object] = {"num_cpus": count, "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
    if address != LOCAL:
        more = {}
        _check_answers(address)
    try:
        import ray  # noqa: PLC0415 - optional
    except ImportError as error:
        raise ConfigError('Ray is not installed; pip install "traffic-dojo[distributed]"') from error
    try:
        ray.init(address, log_to_driver=False, logging_level=logging.ERROR, **more)
    except Exception as error:  # Ray raises plain ones, too
        reason = str(error).strip().splitlines()[0]
        raise ConfigError(f"{address}: no Ray cluster to work on ({reason})") from error
    try:
        yield
    finally:
        ray.shutdown()


def _check_answers(address: str) -> None:
    """See that somebody listens, which Ray itself finds out only after a minute."""
    host, _, port = address.rpartition(":")
    if host.startswith(("127.", "localhost")):
        # Else Ray looks at this machine's other address, where nobody answers.
        os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
    try:
        socket.create_connection((host, int(port)), timeout=_PATIENCE).close()
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"{address}: no Ray cluster answers ({error}); expected HOST:PORT of one, or {LOCAL}"
        ) from error
