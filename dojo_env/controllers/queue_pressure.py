"""Queue pressure: green for whom most wait, with half a vote for those who come and a bonus for staying.

Three lines, nothing learned, no parameter tuned to a place: what a learner has to beat.
"""

from collections import Counter

from dojo_env.controllers.base import Controller
from dojo_env.controllers.max_pressure import share_of_green
from dojo_env.controllers.ranking import choose_best
from dojo_env.instant import Instant
from dojo_maps.signals.programs import green_links


class QueuePressure(Controller):
    """The phase that serves most: 1 for who stands, 0.5 for who moves within 150 m, 1 for the present phase.

    Each vehicle counts for the phases that let its own movement go, with or without priority; who has no room
    to go to counts for none.
    """

    def choose(self, signal: str, instant: Instant) -> int:
        """Count for each phase."""
        view, approach = instant.signals[signal], instant.approach(signal)
        waiting = Counter(approach.links)
        votes = [0.0] * len(view.plan.phases)
        for link, halting in zip(approach.links, approach.halting, strict=True):
            for phase, state in enumerate(view.plan.phases):
                if link in green_links(state) and link not in approach.blocked:
                    votes[phase] += (1.0 if halting else 0.5) * share_of_green(
                        view.plan, state, link, waiting
                    )
        if not any(votes):
            return view.phase
        votes[view.phase] += 1.0
        return choose_best(votes, view.phase)
