"""The map of the episode: the bundle, and what there is to control on it."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from dojo_env.config import SignalConfig
from dojo_env.errors import ConfigError
from dojo_env.managers.base import Manager
from dojo_env.signals.diagram import list_oddities, list_unserved
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
        left_out: signals of the map that no agent can control.
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
        usable = _usable_signals(bundle)
        self.left_out = tuple(s.id for s in bundle.road_map.signals if s.id not in usable)
        chosen = _choose_signals(bundle, usable, config.ts_ids)
        if not config.fixed_ts or config.program != "network":
            refuse_switching((signal.id for signal in chosen), additional)
        self._list_oddities = list_unserved if config.fixed_ts else list_oddities
        wanted = add_programs(chosen, additional)
        self.plans: Mapping[str, SignalPlan] = {
            signal.id: build_plan(bundle.road_map, signal, config) for signal in wanted
        }

    def list_warnings(self) -> Iterator[str]:
        """Tell which signals are not as one may think, in a line for each kind of oddity.

        Where programs run as they stand, what a controller lacks is no oddity.
        """
        by_words: dict[str, list[str]] = {}
        for signal, plan in self.plans.items():
            for words in self._list_oddities(plan):
                by_words.setdefault(words, []).append(signal)
        name = self.bundle.road_map.name
        for words, signals in by_words.items():
            more = f" (as do {len(signals) - 1} more)" if len(signals) > 1 else ""
            yield f"{name}: signal {signals[0]} {words}{more}"


def _usable_signals(bundle: Bundle) -> dict[str, Signal]:
    return {
        signal.id: signal
        for signal in street_signals(bundle.road_map)
        if any(link.kind is LinkKind.VEHICLE for link in signal.links)
    }


def _choose_signals(
    bundle: Bundle, usable: Mapping[str, Signal], ids: tuple[str, ...] | None
) -> list[Signal]:
    name = bundle.road_map.name
    if not usable:
        raise ConfigError(f"map {name} has no signals to control; choose a map with traffic lights")
    missing = [signal for signal in ids or () if signal not in usable]
    if missing or (ids is not None and not ids):
        raise ConfigError(f"map {name} has no signal {missing}; it has {', '.join(usable)}")
    return [usable[signal] for signal in (ids if ids is not None else usable)]
