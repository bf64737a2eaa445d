"""A decision as detectors tell it: controllers that are given this act on what cameras have seen."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import cycle, islice
from types import MappingProxyType

import numpy as np

from dojo_env.detectors.measuring import LaneMeasurements
from dojo_env.errors import ConfigError
from dojo_env.instant import Instant, build_approach
from dojo_env.reading import Approach, LaneGroups, LaneReading
from dojo_env.signals.plan import REACH, ROOM_OF_A_VEHICLE, SignalPlan
from dojo_env.simulation import Simulation

_FRESH = 3.0
"""Seconds after which who moved is no longer where he was."""


class PerceivedInstant(Instant):
    """What was measured of each signal's lanes by detectors; nothing else can be asked for.

    Vehicles go by the numbers of their tracks. Where only their number is known, they are spread over the
    lane. Which link each will take no camera tells, so those of a lane are dealt out to its links in turn,
    from the one that its first vehicle is guessed to take. What emissions they have is not told either, and
    counts as none. Who waits on foot is told by the crossing's push button, which is no camera.
    """

    __slots__ = ()

    def __init__(
        self,
        instant: Instant,
        measured: Mapping[str, LaneMeasurements],
        first_links: Mapping[str, Mapping[str, int]] = MappingProxyType({}),
    ) -> None:
        """Take the place of an instant.

        Args:
            instant: tells the time and the signals' own states.
            measured: of each of its signals, at least the lanes that lead to it and away from it.
            first_links: by signal and lane, the link that the first vehicle is guessed to take.
        """
        self.time, self.traffic = instant.time, instant.traffic
        self.tells_places = all(each.places and self.time - each.time <= _FRESH for each in measured.values())
        self.signals = MappingProxyType(
            {
                signal: replace(view, lanes=read_lanes(measured[signal], view.plan))
                for signal, view in instant.signals.items()
            }
        )
        self._simulation, self._moment, self._snapshot = None, 0, None
        self._crossings = frozenset(
            crossing
            for signal, view in self.signals.items()
            for wanted in [instant.list_wanted_walks(signal)]
            for link, crossing in view.plan.walks
            if link in wanted
        )
        self._lanes = {
            lane: tuple(f"{signal} {number}" for number in numbers)
            for signal, each in measured.items()
            for lane, numbers in zip(each.lanes, each.tracks, strict=True)
        }
        self._approaches = {
            signal: _list_approach(measured[signal], view.plan, first_links.get(signal, {}))
            for signal, view in self.signals.items()
        }

    def _present(self, what: str) -> Simulation:
        raise ConfigError(
            f"no camera tells the {what}; give the controller the truth, without a detector, or another one"
        )


def read_lanes(measured: LaneMeasurements, plan: SignalPlan) -> LaneReading:
    """Turn measurements into the figures of the lanes that lead to a signal.

    Args:
        measured: what a sensor has measured, by lane.
        plan: of the signal.

    Returns:
        Their figures, without CO2.
    """
    rows = [measured.lanes.index(lane) for lane in plan.lanes]
    speed = measured.mean_speed[rows]
    raw = (
        measured.vehicles[rows],
        measured.halting[rows],
        np.where(np.isnan(speed), plan.limits, speed),
        measured.mean_length[rows],
        measured.waiting[rows],
        np.zeros(len(rows)),
    )
    (reading,) = LaneGroups([(plan.lanes, plan.limits, plan.lengths)]).divide([each.tolist() for each in raw])
    return reading


def _list_approach(measured: LaneMeasurements, plan: SignalPlan, first_links: Mapping[str, int]) -> Approach:
    number = {lane: k for k, lane in enumerate(measured.lanes)}
    coming: list[tuple[int, float, float]] = []
    for lane, limit, length in zip(plan.lanes, plan.limits, plan.lengths, strict=True):
        own = plan.list_links(lane)
        begin = own.index(first_links[lane]) if lane in first_links else 0
        own = own[begin:] + own[:begin]
        if lane in measured.places:
            coming += [
                (link, metres, 0.0 if stands else float(limit))
                for link, (metres, stands) in zip(cycle(own), measured.places[lane], strict=False)
            ]
            continue
        count, standing = (int(each[number[lane]]) for each in (measured.vehicles, measured.halting))
        # Who stands is in front; the others are spread over what is left of the lane.
        queue = min(standing * ROOM_OF_A_VEHICLE, REACH)
        apart = max(0.0, min(length, REACH) - queue) / max(1, count - standing + 1)
        for k, link in enumerate(islice(cycle(own), count)):
            if k < standing:
                coming.append((link, min(k * ROOM_OF_A_VEHICLE, REACH), 0.0))
            else:
                coming.append((link, queue + (k - standing + 1) * apart, float(limit)))
    return build_approach(
        plan,
        coming,
        [float(measured.halting[number[lane]]) for lane in plan.out_lanes],
        [index for index, source, _ in plan.links if source in measured.urgent],
    )
