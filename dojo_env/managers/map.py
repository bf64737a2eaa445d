"""The map of the episode: the bundle, and what there is to control on it."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.managers.base import Manager
from dojo_env.signals.plan import SignalPlan, build_plan
from dojo_env.signals.programs import add_programs, refuse_switching
from dojo_maps.bundle import Bundle
from dojo_maps.description import LinkKind, Signal
from dojo_maps.railways import street_signals


class MapManager(Manager):
    """Owns the bundle and a plan for each signal that agents control; no episode changes either.

    Attributes:
        bundle: the map.
        plans: by signal, in the map's order.
    """

    def __init__(self, bundle: Bundle, config: SignalConfig, *, additional: Sequence[Path] = ()) -> None:
        """Plan the signals.

        Args:
            bundle: the map.
            config: which signals to control, and how.
            additional: files that may hold other programs for them.

        Raises:
            ConfigError: the map has no signal to control, lacks one that is named, or SUMO switches the
                programs of one by the clock while something else should control it.
        """
        self.bundle = bundle
        chosen = _choose_signals(bundle, config.ts_ids)
        if not config.fixed_ts or config.program != "network":
            refuse_switching((signal.id for signal in chosen), additional)
        wanted = add_programs(chosen, additional)
        self.plans: Mapping[str, SignalPlan] = {
            signal.id: build_plan(bundle.road_map, signal, config) for signal in wanted
        }


def _choose_signals(bundle: Bundle, ids: tuple[str, ...] | None) -> list[Signal]:
    usable = {
        signal.id: signal
        for signal in street_signals(bundle.road_map)
        if any(link.kind is LinkKind.VEHICLE for link in signal.links)
    }
    name = bundle.road_map.name
    if not usable:
        raise ConfigError(f"map {name} has no signals to control; choose a map with traffic lights")
    missing = [signal for signal in ids or () if signal not in usable]
    if missing or (ids is not None and not ids):
        raise ConfigError(f"map {name} has no signal {missing}; it has {', '.join(usable)}")
    return [usable[signal] for signal in (ids if ids is not None else usable)]
