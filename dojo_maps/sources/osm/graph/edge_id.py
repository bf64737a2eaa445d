"""The directed edges that a section becomes in SUMO's network, and how they are named there."""

from typing import NamedTuple


class EdgeId(NamedTuple):
    """One direction of a section.

    Attributes:
        section: the section's id.
        forward: along its nodes, not against them.
    """

    section: str
    forward: bool

    @classmethod
    def read(cls, name: str) -> "EdgeId":
        """Read the name that SUMO knows an edge by; a minus stands for the way back.

        Args:
            name: the edge's id in the network.

        Returns:
            The section and the direction.
        """
        return cls(name.removeprefix("-"), not name.startswith("-"))

    def __str__(self) -> str:
        """Write the name that SUMO knows the edge by."""
        return self.section if self.forward else f"-{self.section}"
