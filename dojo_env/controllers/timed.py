"""A signal timing plan: the same cycle again and again, or SUMO's logics with times of its own."""

from pathlib import Path

from dojo_env.controllers.base import Controller
from dojo_env.timing_plans import TimingPlan, read_plan


class Timed(Controller):
    """Leaves every signal to a timing plan, which sees nothing where its logic is `fixed`."""

    def __init__(self, plan: TimingPlan | Path) -> None:
        """Take a plan, or read its file.

        Raises:
            PlanError: the file holds none.
        """
        super().__init__({"timing": read_plan(plan) if isinstance(plan, Path) else plan})
        self.name = plan.name if isinstance(plan, Path) else "timing plan"
