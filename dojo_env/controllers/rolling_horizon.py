"""Rolling horizon: green for the phase under which, a minute ahead, the least waiting is to be expected.

Nothing learned. What a learner has to beat where the queues can be foreseen.

Source: Gartner, OPAC: a demand-responsive strategy for traffic signal control, TRR 906, 1983.
"""

from dojo_env.controllers.base import Controller
from dojo_env.instant import Instant
from dojo_env.queue_forecast import QueueForecast


class RollingHorizon(Controller):
    """The phase of the least delay, by `queue_forecast`; the present one, where nobody gains by a change."""

    def __init__(self) -> None:
        """Begin without a signal."""
        super().__init__()
        self._forecasts: dict[str, QueueForecast] = {}

    def reset(self, seed: int) -> None:
        """Forget the signals of the last map."""
        self._forecasts = {}

    def choose(self, signal: str, instant: Instant) -> int:
        """Measure what each phase comes to."""
        view = instant.signals[signal]
        if signal not in self._forecasts:
            self._forecasts[signal] = QueueForecast(view.plan)
        delays = self._forecasts[signal].measure_delays(
            view, instant.approach(signal), instant.list_wanted_walks(signal)
        )
        return view.phase if delays[view.phase] == 0.0 else int(delays.argmin())
