"""Where the episodes of a training run: processes of this machine, or nodes of a Ray cluster."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any, Protocol

from dojo_env.clusters import collect_results, open_cluster

_RETRIES = 5
"""How many lost nodes an episode survives."""
_THREADS = "OPENBLAS_NUM_THREADS"
"""NumPy's threads: where each process has one for every core, they spend most of their time on each other."""


class Mapper(Protocol):
    """Runs a function on many values, wherever there is room; gives what it returns in the values' order."""

    def __call__(self, function: Callable[[Any], Any], values: Sequence[Any]) -> list[Any]:
        """Run."""
        ...


@contextmanager
def open_processes(count: int) -> Iterator[Mapper]:
    """Open processes of this machine to simulate in.

    Args:
        count: processes, each of which does one thing at a time.

    Yields:
        What runs a function on many values in them; all of these can be pickled.
    """
    with ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=_use_one_thread) as pool:
        yield lambda function, values: list(pool.map(function, values))


def _use_one_thread() -> None:
    """Let each process that is started from here compute on one thread, unless the user says otherwise."""
    os.environ.setdefault(_THREADS, "1")


@contextmanager
def open_nodes(address: str, count: int) -> Iterator[Mapper]:
    """Connect to a Ray cluster to simulate on; what a lost node did is done again on another.

    Args:
        address: see `open_cluster`.
        count: episodes at once, where the address is `local`.

    Yields:
        What runs a function on many values on the nodes.

    Raises:
        ConfigError: no cluster answers.
    """
    with open_cluster(address, count):
        import ray

        def run_all(function: Callable[[Any], Any], values: Sequence[Any]) -> list[Any]:
            remote = ray.remote(num_cpus=1, max_retries=_RETRIES, scheduling_strategy="SPREAD")(_call)
            running = {remote.remote(function, value): place for place, value in enumerate(values)}
            found = dict(collect_results(running, lambda place: f"episode {place}"))
            return [found[place] for place in range(len(values))]

        yield run_all


def _call(function: Callable[[Any], Any], value: Any) -> Any:
    return function(value)
