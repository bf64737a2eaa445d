"""Which way the first vehicle of a lane goes, as far as its waiting at green tells.

No camera tells where a vehicle will turn. Where one green lets some of a lane's links go and not all, whoever
wants another one stands on, and everybody behind him.
"""

from collections import defaultdict
from collections.abc import Mapping

from dojo_env.detectors.measuring import LaneMeasurements
from dojo_env.instant import Instant, SignalView

_AT_THE_LINE = 10.0
"""Metres from the stop line within which a vehicle is the first one."""
_GONE = 5.0
"""Seconds of green with priority after which the first one does not stand any more."""


class TurnGuesses:
    """Remembers for how long links have been green, and which ones each lane's first vehicle did not take."""

    def __init__(self) -> None:
        """Begin with nothing known."""
        self._since: dict[str, dict[int, float]] = {}
        self._not_taken: defaultdict[tuple[str, str], set[int]] = defaultdict(set)

    def note(self, instant: Instant, measured: Mapping[str, LaneMeasurements]) -> dict[str, dict[str, int]]:
        """Note a decision.

        Args:
            instant: tells the time and the signals' own states.
            measured: of each of its signals, its lanes.

        Returns:
            By signal and lane, the link that the first vehicle takes, where its waiting tells something.
        """
        guessed: dict[str, dict[str, int]] = {signal: {} for signal in instant.signals}
        for signal, view in instant.signals.items():
            green_for = self._time_greens(signal, view, instant.time)
            for lane in view.plan.lanes:
                own = view.plan.list_links(lane)
                (metres, stands), *_ = (*measured[signal].places.get(lane, ()), (_AT_THE_LINE, False))
                not_taken = self._not_taken[signal, lane]
                not_taken.update(link for link in own if green_for.get(link, 0.0) >= _GONE)
                left = [link for link in own if link not in not_taken]
                if not (stands and metres < _AT_THE_LINE and left):
                    # Another one is the first now, or something else keeps him.
                    not_taken.clear()
                elif not_taken:
                    guessed[signal][lane] = left[0]
        return guessed

    def _time_greens(self, signal: str, view: SignalView, time: float) -> dict[int, float]:
        """Tell for how many seconds each link has been green with priority."""
        before = self._since.get(signal, {})
        self._since[signal] = {
            link: before.get(link, time) for link, letter in enumerate(view.state) if letter == "G"
        }
        return {link: time - since for link, since in self._since[signal].items()}
