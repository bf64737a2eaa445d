"""The benchmark's rows on a Ray cluster, whose nodes need share no disk."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from dojo_env.benchmark.row_runs import FIGURES, find_folder, run_row
from dojo_env.clusters import collect_results, open_cluster
from dojo_maps.progress import say
from dojo_maps.whole_file import replaced

_RETRIES = 5
"""How many lost nodes a row survives."""


def run_rows(tasks: list[dict[str, Any]], results: Path, address: str, jobs: int) -> None:
    """Run rows on a cluster's nodes; a row whose node is lost is run again on another.

    Args:
        tasks: what `describe` tells of each row.
        results: where this process writes what the nodes send.
        address: see `open_cluster`.
        jobs: rows at once, where the address is `local`.

    Raises:
        SimulationError: a row has lost too many nodes.
    """
    with open_cluster(address, jobs):
        import ray

        # A fresh process for each row, spread over the nodes.
        remote = ray.remote(max_calls=1, max_retries=_RETRIES, scheduling_strategy="SPREAD")(_run_row)
        largest = max(node["Resources"].get("CPU", 0) for node in ray.nodes() if node["Alive"])
        running = {
            remote.options(num_cpus=min(_count_processes(task), largest)).remote(
                task, _read_files(find_folder(task["row"], task["scenario"], results))
            ): task
            for task in tasks
        }
        for task, files in collect_results(running, lambda task: f"{task['scenario']}: {task['row']}"):
            _write_files(files, find_folder(task["row"], task["scenario"], results))
            say(f"{task['scenario']}: {task['row']}")


def _count_processes(task: Mapping[str, Any]) -> int:
    return task["training"]["processes"] if "training" in task else 1


def _run_row(task: Mapping[str, Any], known: dict[str, bytes]) -> dict[str, bytes]:
    """Run a row on a node, from the files that are known of it to those that are there afterwards."""
    with TemporaryDirectory() as results:
        folder = find_folder(task["row"], task["scenario"], Path(results))
        _write_files(known, folder)
        run_row(task, Path(results))
        return _read_files(folder)


def _read_files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _write_files(files: Mapping[str, bytes], folder: Path) -> None:
    """Write files, the figures last: they tell that a row is done."""
    for name in sorted(files, key=lambda name: name == FIGURES):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        with replaced(folder / name) as fresh:
            fresh.write_bytes(files[name])
