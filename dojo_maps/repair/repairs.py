"""Every repair by its check, in the order in which they are made."""

from dojo_maps.repair.crossing_repairs import add_crossings
from dojo_maps.repair.edits import Repair
from dojo_maps.repair.green_repairs import give_green
from dojo_maps.repair.joining import join_signals
from dojo_maps.repair.lane_repairs import lead_on
from dojo_maps.repair.reference_repairs import (
    drop_unused_letters,
    mend_references,
    remove_copies,
)  # fmt: skip
from dojo_maps.repair.road_repairs import join_short_roads
from dojo_maps.repair.rule_repairs import complete_rules
from dojo_maps.repair.shape_repairs import close_gaps, drop_repeated_points, trim_pavement, untwist_outlines
from dojo_maps.repair.signal_repairs import (
    add_yellow,
    complete_states,
    lengthen_yellow,
    let_yield,
    repair_programs,
)  # fmt: skip
from dojo_maps.repair.walk_repairs import clear_crossings, lengthen_walks

REPAIRS: dict[str, Repair] = {
    "topology.duplicate_id": remove_copies,
    "topology.dangling_reference": mend_references,
    "topology.request_mismatch": complete_rules,
    "geometry.short_edge": join_short_roads,
    "topology.lane_dead_end": lead_on,
    "geometry.lane_invalid": drop_repeated_points,
    "geometry.junction_invalid": untwist_outlines,
    "geometry.gap": close_gaps,
    "geometry.sidewalk_on_road": trim_pavement,
    "signals.state_length": repair_programs(complete_states, uncovers=True),
    "signals.unused_index": drop_unused_letters,
    "signals.split_signals": join_signals,
    "signals.never_green": repair_programs(give_green),
    "signals.green_conflict": repair_programs(let_yield),
    "signals.missing_yellow": repair_programs(add_yellow),
    "signals.yellow_short": repair_programs(lengthen_yellow),
    "pedestrians.missing_crossing": add_crossings,
    "pedestrians.crossing_clearance": repair_programs(clear_crossings),
    "pedestrians.walk_min": repair_programs(lengthen_walks),
}
ON_REQUEST = frozenset({"pedestrians.missing_crossing", "geometry.short_edge"})
"""Checks that are repaired only when they are named: netconvert builds the whole network anew, and it gets
what it never had, or loses roads that routes may name."""
