"""Every repair by its check, in the order in which they are made."""

from dojo_maps.repair.edits import Repair
from dojo_maps.repair.signal_repairs import (
    add_yellow,
    complete_states,
    lengthen_yellow,
    let_yield,
    repair_programs,
)  # fmt: skip
from dojo_maps.repair.walk_repairs import clear_crossings, lengthen_walks

REPAIRS: dict[str, Repair] = {
    "signals.state_length": repair_programs(complete_states),
    "signals.green_conflict": repair_programs(let_yield),
    "signals.missing_yellow": repair_programs(add_yellow),
    "signals.yellow_short": repair_programs(lengthen_yellow),
    "pedestrians.crossing_clearance": repair_programs(clear_crossings),
    "pedestrians.walk_min": repair_programs(lengthen_walks),
}
ON_REQUEST: frozenset[str] = frozenset()
"""Checks that are repaired only when they are named: their repair adds to a network what it never had."""
