"""Defects planted in real networks: each kind changes one thing, and says who must report it and where.

A kind takes a parsed network and a source of chance, changes the network in place and returns what it
planted, or raises NoPlaceError where the network has no place for it.
"""

import random
from collections.abc import Callable

from mutations import lights, shapes, walks, ways
from mutations.net import Net, NoPlaceError, Planted

Kind = Callable[[Net, random.Random], Planted]
KINDS: tuple[Kind, ...] = (
    ways.drop_connection,
    ways.dangle_connection,
    ways.forbid_lane,
    ways.duplicate_edge,
    ways.drop_request,
    ways.cut_network,
    ways.repeat_connection,
    ways.misname_via,
    ways.misname_junction,
    ways.strand_lane,
    ways.strand_edge,
    ways.turn_back_only,
    ways.close_lane,
    shapes.cross_lanes,
    shapes.swap_lanes,
    shapes.shift_sidewalk,
    shapes.tear_lane,
    shapes.squeeze_width,
    shapes.squeeze_crossing,
    shapes.turn_lane_around,
    shapes.repeat_point,
    shapes.kink_lane,
    shapes.lift_lane_end,
    shapes.stretch_length,
    shapes.twist_junction,
    shapes.move_node,
    shapes.stack_junctions,
    shapes.lay_on_opposite,
    shapes.widen_lane,
    shapes.squeeze_sidewalk,
    shapes.raise_lane_middle,
    shapes.hook_lane_end,
    shapes.loop_lane,
    shapes.shorten_edge,
    shapes.shrink_way,
    shapes.cross_turns,
    shapes.stray_over_road,
    shapes.wait_in_path,
    lights.green_foes,
    lights.never_green,
    lights.cut_state,
    lights.remove_yellow,
    lights.shorten_yellow,
    lights.add_letter,
    lights.never_stop,
    lights.stop_changing,
    lights.drop_yellow_phases,
    lights.stretch_cycle,
    lights.starve_link,
    lights.speed_up_turn,
    lights.move_signal,
    lights.slow_down,
    walks.shorten_clearance,
    walks.walk_before_green,
    walks.unlink_crossing,
    walks.drop_crossing_target,
    walks.isolate_walking_area,
    walks.shrink_walking_area,
    walks.move_crossing,
    walks.split_walking_area,
    walks.leave_crossing_one_end,
    walks.misname_crossed_road,
    walks.twist_walking_area,
    walks.hurry_walkers,
    walks.drop_crossing,
    walks.cramp_walkers,
)
__all__ = ["KINDS", "Kind", "Net", "NoPlaceError", "Planted"]
