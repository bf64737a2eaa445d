"""Which way the first vehicle of a lane goes, as far as its waiting at green tells."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from dojo_env.config import build_config
from dojo_env.detectors.measuring import LaneMeasurements
from dojo_env.instant import Instant
from dojo_env.local_world import LocalWorld
from dojo_env.perceived import PerceivedInstant
from dojo_env.turn_guesses import TurnGuesses


@pytest.fixture(scope="module")
def first() -> Instant:
    with closing(LocalWorld(build_config(scenario="two-way", num_seconds=60))) as world:
        world.reset(1)
        return world.instant.measure_all()


class Junction:
    """A lane with two links, seen every five seconds."""

    def __init__(self, first: Instant) -> None:
        (self.signal,) = first.signals
        self.view = first.signals[self.signal]
        plan = self.view.plan
        self.lane = next(
            lane
            for lane in plan.lanes
            if len({link for link, source, _ in plan.links if source == lane}) == 2
        )
        self.links = sorted({link for link, source, _ in plan.links if source == self.lane})
        self.lanes = tuple(dict.fromkeys((*plan.lanes, *plan.out_lanes)))
        self.guesses = TurnGuesses()

    def look(self, time: float, letters: str, *places: tuple[float, bool]) -> list[int]:
        """Tell the links that the lane's vehicles are taken to take, when its own show these letters."""
        state = list("r" * len(self.view.state))
        for link, letter in zip(self.links, letters, strict=True):
            state[link] = letter
        now = Instant.of_views(time, {self.signal: replace(self.view, state="".join(state))})
        none = np.zeros(len(self.lanes))
        measured = {
            self.signal: LaneMeasurements(
                time=time, lanes=self.lanes, vehicles=none, halting=none, mean_speed=none, mean_length=none,
                waiting=none, tracks=((),) * len(self.lanes),
                places=dict.fromkeys(self.lanes, ()) | {self.lane: places},
            )
        }  # fmt: skip
        perceived = PerceivedInstant(now, measured, self.guesses.note(now, measured))
        return [link for link, _, _ in perceived.approach(self.signal).coming]


STANDS, BEHIND = (1.0, True), (9.0, True)


def test_who_stands_while_one_link_is_green_takes_the_other(first: Instant) -> None:
    junction = Junction(first)
    one, two = junction.links
    assert junction.look(0, "rr", STANDS, BEHIND) == [one, two]
    assert junction.look(5, "Gr", STANDS, BEHIND) == [one, two]
    assert junction.look(10, "Gr", STANDS, BEHIND) == [two, one]
    # As long as he stands there, whatever is shown.
    assert junction.look(15, "rr", STANDS) == [two]
    # Another one is the first.
    assert junction.look(20, "rG", (30.0, False)) == [one]
    assert junction.look(25, "rr", STANDS) == [one]


def test_who_stands_although_all_is_green_or_yields_tells_nothing(first: Instant) -> None:
    junction = Junction(first)
    one, two = junction.links
    for time in range(0, 30, 5):
        assert junction.look(time, "gr", STANDS, BEHIND) == [one, two]
    for time in range(30, 60, 5):
        assert junction.look(time, "GG", STANDS, BEHIND) == [one, two]
    # Nor does who comes to the end of the queue.
    for time in range(60, 90, 5):
        assert junction.look(time, "Gr", (15.0, True)) == [one]
