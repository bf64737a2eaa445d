"""RESCO's scenarios with SUMO-RL's environments (https://people.engr.tamu.edu/guni/Papers/NeurIPS-signals.pdf)."""

from collections.abc import Callable
from typing import Any

from dojo_env.scenario import packaged_scenario

from .petting_zoo import env, parallel_env


def _make(name: str) -> Callable[..., Any]:
    def make(parallel: bool = True, **kwargs: Any) -> Any:
        scenario = packaged_scenario(name)
        files = {"net_file": scenario.map, "route_file": scenario.routes[0], "begin_time": scenario.begin}
        return (parallel_env if parallel else env)(**{**kwargs, **files, "num_seconds": 3600})

    make.__name__ = name
    make.__doc__ = f"Make RESCO's {name}: agents act all at once (`parallel`), or in turn."
    return make


arterial4x4 = _make("arterial4x4")
cologne1 = _make("cologne1")
cologne3 = _make("cologne3")
cologne8 = _make("cologne8")
grid4x4 = _make("grid4x4")
ingolstadt1 = _make("ingolstadt1")
ingolstadt7 = _make("ingolstadt7")
ingolstadt21 = _make("ingolstadt21")
