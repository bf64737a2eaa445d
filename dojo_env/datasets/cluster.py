"""Parts made on a Ray cluster, whose nodes need share no disk: what a node has made comes back as bytes."""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from dojo_env.clusters import collect_results, open_cluster
from dojo_env.datasets.parts import make_part
from dojo_env.datasets.settings import DatasetSettings, Job
from dojo_env.datasets.workers import Worker
from dojo_maps.whole_file import replaced_folder

_RETRIES = 5
"""How many lost nodes a part survives."""


def run_on_cluster(
    settings: DatasetSettings, jobs: Sequence[Job], parts: Path, address: str, count: int
) -> Iterator[Job]:
    """Make parts on a cluster's nodes.

    Args:
        settings: of the data set; scenarios and cameras are packaged names, or paths that all nodes have.
        jobs: the episodes.
        parts: where their parts go.
        address: see `open_cluster`.
        count: parts made at once by a local one.

    Yields:
        Each episode, when its part is written here.

    Raises:
        ConfigError: Ray is not installed, or no cluster answers.
        SimulationError: a part has lost too many nodes.
    """
    with open_cluster(address, count):
        import ray  # noqa: PLC0415 - optional

        remote = ray.remote(num_cpus=1, max_retries=_RETRIES, scheduling_strategy="SPREAD")(_make_on_node)
        running = {remote.remote(settings, job): job for job in jobs}
        for job, files in collect_results(running, lambda job: f"episode {job.number}"):
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
