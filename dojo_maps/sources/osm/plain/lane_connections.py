"""From which lane of a road into which lane of another: by the arrows painted, or as a driver expects.

Lanes are numbered from the outermost; angles are in degrees, positive to the inner side of the road.
"""

from collections.abc import Iterator, Mapping, Sequence

from dojo_maps.sources.osm.read.lane_tags import LaneTags

_ARROWS = {
    "through": 0.0, "slight_right": -35.0, "right": -85.0, "sharp_right": -135.0, "slight_left": 35.0,
    "left": 85.0, "sharp_left": 135.0, "reverse": 180.0, "merge_to_left": 0.0, "merge_to_right": 0.0,
}  # fmt: skip
STRAIGHT = 42.0
"""Degrees of a turn that is still straight on."""


def arrow_targets(turn: str, angles: Sequence[float], *, left_hand: bool) -> int | None:
    """Find the movement that an arrow is for.

    Args:
        turn: the arrow, as a value of the tag `turn:lanes`.
        angles: of the road's movements, degrees, positive to the inner side.
        left_hand: traffic keeps left, so that right is the inner side.

    Returns:
        The number of the movement; None where none fits.
    """
    wanted = _ARROWS.get(turn)
    if wanted is None:
        return None
    wanted = -wanted if left_hand and abs(wanted) < 180 else wanted
    fitting = [k for k, angle in enumerate(angles) if _fits(wanted, angle)]
    return min(fitting, key=lambda k: (abs(angles[k] - wanted), k)) if fitting else None


def connect_lanes(
    lanes: Sequence[LaneTags],
    targets: Sequence[Sequence[LaneTags]],
    angles: Sequence[float],
    *,
    left_hand: bool,
) -> list[tuple[int, int, int]]:
    """Connect the lanes of a road to those of the roads that it leads to.

    Args:
        lanes: of the road, outermost first.
        targets: the lanes of each movement's road.
        angles: of the movements, ascending.
        left_hand: whether traffic keeps left.

    Returns:
        (lane, movement, target lane); each lane leads somewhere, each movement has a lane.
    """
    if not targets:
        return []
    motor = _motor(lanes)
    onto = [_motor(target) for target in targets]
    links = _connect_motor_lanes(
        [lanes[k] for k in motor],
        [[target[k] for k in kept] for target, kept in zip(targets, onto, strict=True)],
        angles,
        left_hand=left_hand,
    )
    found = [(motor[lane], movement, onto[movement][end]) for lane, movement, end in links]
    return sorted({*found, *_connect_cycle_lanes(lanes, targets, angles)})


def _motor(lanes: Sequence[LaneTags]) -> list[int]:
    """Number the lanes that motor vehicles drive on; all where there are no others."""
    return [k for k, lane in enumerate(lanes) if lane.motor] or list(range(len(lanes)))


def _connect_cycle_lanes(
    lanes: Sequence[LaneTags], targets: Sequence[Sequence[LaneTags]], angles: Sequence[float]
) -> Iterator[tuple[int, int, int]]:
    """Lead cycle lanes straight on and to their side; bicycles that turn to the other change lanes before."""
    innermost = max((k for k, lane in enumerate(lanes) if lane.motor), default=len(lanes))
    for number, lane in enumerate(lanes):
        if not lane.bicycle:
            continue
        side = -1 if number > innermost else 1
        own = [k for k, angle in enumerate(angles) if angle * side <= STRAIGHT]
        for movement in own or range(len(targets)):
            target = list(enumerate(targets[movement]))[::side]
            fitting = [k for k, onto in target if onto.bicycle]
            fitting += [k for k, onto in target if onto.motor and not onto.bus]
            if fitting:
                yield number, movement, fitting[0]


def _connect_motor_lanes(
    lanes: Sequence[LaneTags],
    targets: Sequence[Sequence[LaneTags]],
    angles: Sequence[float],
    *,
    left_hand: bool,
) -> list[tuple[int, int, int]]:
    chosen = _painted(lanes, angles, left_hand=left_hand) if any(lane.turns for lane in lanes) else None
    chosen = chosen or _expected(lanes, angles)
    links: list[tuple[int, int, int]] = []
    for movement, target in enumerate(targets):
        sources = sorted(lane for lane, movements in chosen.items() if movement in movements)
        links += [
            (lane, movement, onto)
            for lane, onto in _pair(lanes, sources, target, angles[movement], len(targets))
        ]
    return _without_needless_merges(lanes, links, angles)


def _without_needless_merges(
    lanes: Sequence[LaneTags], links: list[tuple[int, int, int]], angles: Sequence[float]
) -> list[tuple[int, int, int]]:
    """Let one lane only lead into each lane, where the others lead elsewhere too and have no arrow there.

    Vehicles that merge inside a junction wait for each other, in the worst case for ever.
    """
    kept = list(links)
    for link in sorted(links, key=lambda e: (e[1], e[0] if angles[e[1]] > 0 else -e[0])):
        lane, movement, onto = link
        merges = any(other[1:] == (movement, onto) and other[0] != lane for other in kept)
        elsewhere = any(other[0] == lane and other[1] != movement for other in kept)
        if merges and elsewhere and not (lanes[lane].turns or lanes[lane].bus):
            kept.remove(link)
    return kept


def _fits(wanted: float, angle: float) -> bool:
    if abs(wanted) < 1:
        return abs(angle) <= 60
    if abs(wanted) >= 180:
        return angle > 140  # Nobody turns back to the outer side.
    return angle * wanted > 0 and abs(angle) >= (20 if abs(wanted) > 50 else 8)


def _painted(
    lanes: Sequence[LaneTags], angles: Sequence[float], *, left_hand: bool
) -> dict[int, set[int]] | None:
    chosen: dict[int, set[int]] = {}
    for number, lane in enumerate(lanes):
        found = {arrow_targets(turn, angles, left_hand=left_hand) for turn in lane.turns}
        chosen[number] = {movement for movement in found if movement is not None}
    if not any(chosen.values()):
        return None
    main = min(range(len(angles)), key=lambda k: (abs(angles[k]), k))
    chosen = {number: movements or {main} for number, movements in chosen.items()}
    for movement, angle in enumerate(angles):
        if not any(movement in movements for movements in chosen.values()):
            chosen[_lane_beside(chosen, movement, outer=angle < angles[main])].add(movement)
    return chosen


def _lane_beside(chosen: Mapping[int, set[int]], movement: int, *, outer: bool) -> int:
    """Find the lane nearest its side from which a movement crosses no other.

    Args:
        chosen: the movements of each lane so far, both from the outside.
        movement: has no lane yet.
        outer: it turns to the outer side of the main one, or else to the inner side.
    """
    if outer:
        farther_out = (lane for lane, known in chosen.items() if any(k < movement for k in known))
        return max(farther_out, default=min(chosen))
    farther_in = (lane for lane, known in chosen.items() if any(k > movement for k in known))
    return min(farther_in, default=max(chosen))


def _expected(lanes: Sequence[LaneTags], angles: Sequence[float]) -> dict[int, set[int]]:
    """Give the straight movement all lanes, turns the lane on their side; split a road that ends."""
    cars = [number for number, lane in enumerate(lanes) if not lane.bus] or list(range(len(lanes)))
    chosen: dict[int, set[int]] = {number: set() for number in range(len(lanes))}
    main = min(range(len(angles)), key=lambda k: (abs(angles[k]), k))
    if abs(angles[main]) <= STRAIGHT or len(angles) == 1:
        for movements in chosen.values():
            movements.add(main)
    else:
        for place, number in enumerate(cars):
            part = place * len(angles) // len(cars)
            chosen[number].add(min(part, len(angles) - 1))
        for number in set(chosen) - set(cars):
            chosen[number] |= chosen[cars[0] if number < cars[0] else cars[-1]]
    for movement, angle in enumerate(angles):
        if not any(movement in movements for movements in chosen.values()):
            outer = angle < angles[main] or (angle == angles[main] and movement < main)
            open_to_cars = {number: chosen[number] for number in cars}
            chosen[_lane_beside(open_to_cars, movement, outer=outer)].add(movement)
    for number in range(cars[0]):
        chosen[number] |= {movement for movement in chosen[cars[0]] if angles[movement] < -STRAIGHT}
    return chosen


def _pair(
    lanes: Sequence[LaneTags],
    sources: Sequence[int],
    target: Sequence[LaneTags],
    angle: float,
    movements: int,
) -> list[tuple[int, int]]:
    """Pair a movement's lanes with its road's lanes, kept in order.

    Where the road has no bus lane, buses keep to their side: on a lane of their own if there is one more.
    """
    buses = [number for number, lane in enumerate(target) if lane.bus]
    onto = [number for number in range(len(target)) if number not in buses] or buses
    cars = [number for number in sources if not lanes[number].bus]
    if not cars or (not buses and len(sources) <= len(onto)):
        cars = list(sources)
    inner = angle > STRAIGHT or (abs(angle) <= STRAIGHT and movements == 1 and len(cars) > len(onto))
    shift = len(onto) - len(cars) if inner or lanes[cars[-1]].bus else 0
    pairs = [(lane, onto[max(0, min(place + shift, len(onto) - 1))]) for place, lane in enumerate(cars)]
    general = [pair for pair in pairs if not lanes[pair[0]].bus] or pairs
    for lane in sources:
        if lane not in cars:
            beside = pairs[0][1] if lane < cars[0] else pairs[len(cars) - 1][1]
            pairs.append((lane, buses[0] if buses else beside))
    if len(onto) > len(cars) and movements == 1:
        used = {onto_lane for _, onto_lane in pairs}
        pairs += [
            (min(reversed(general), key=lambda pair: abs(pair[1] - number))[0], number)
            for number in onto
            if number not in used
        ]
    return sorted(set(pairs))
