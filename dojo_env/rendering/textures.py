"""Procedural textures: how bright each surface is at a place of the map. Pure functions of position."""

from math import floor, sin, sqrt

from dojo_env.rendering.compiling import kernel

_TRACK, _TRACK_WIDTH = 0.78, 0.42
"""Where wheels run, to either side of a lane's middle, and how wide they wear it, metres."""
_FLOOR, _BAY = 3.0, 2.1
"""Height of a storey, and the least that a window and the wall beside it take, metres."""
_GROUND_FLOOR, _SHOP_BAY = 3.5, 4.2
_SILL, _SURROUND = 0.85, 0.1
"""Height of window sills above the floor, and width of what frames a window in the wall, metres."""
_EAVES, _SHADOW = 0.3, 0.4
"""Height of the boards along a roof's edge, and of their shadow on the wall, metres."""
_REVEAL = 0.13
"""Height of the shadow that a lintel throws on the pane behind it, metres."""
_PIPE_APART = 11.0
"""Metres between downpipes."""
_WORN_WHITE = 0.5
"""Brightness of road paint that is some years old, as a share of new paint's."""
_COVER = 0.33
"""Radius of a manhole's cover, metres."""


@kernel
def _hashed(x, y):
    """A number from 0 to 1 for two integers. Source: the finaliser of MurmurHash3."""
    h = (x * 374761393 + y * 668265263) & 0xFFFFFFFF
    h = ((h ^ (h >> 15)) * 2246822519) & 0xFFFFFFFF
    h = ((h ^ (h >> 13)) * 3266489917) & 0xFFFFFFFF
    return ((h ^ (h >> 16)) & 0xFFFFFF) / 16777215.0


@kernel
def _smooth_noise(x, y):
    i, j = floor(x), floor(y)
    u, v = x - i, y - j
    u, v = u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v)
    low = _hashed(i, j) * (1.0 - u) + _hashed(i + 1, j) * u
    high = _hashed(i, j + 1) * (1.0 - u) + _hashed(i + 1, j + 1) * u
    return low * (1.0 - v) + high * v


@kernel
def _layered_noise(x, y, pixel):
    """Sum four octaves of noise around 0; octaves finer than a pixel (in units of x) fade out."""
    total, gain, scale = 0.0, 0.5, 1.0
    for _ in range(4):
        shown = _shown(pixel * scale)
        if shown > 0.0:
            total += gain * shown * (_smooth_noise(x * scale + 17.0, y * scale + 5.0) - 0.5)
        gain *= 0.55
        scale *= 2.1
    return total


@kernel
def _shown(pixels):
    """How much of a detail shows when a pixel is as large as this many of it."""
    return min(1.0, max(0.0, 1.5 - 2.0 * pixels))


@kernel
def _stripe(distance, width, pixel):
    """Share of a pixel that a line covers: all in its middle, and never more than its width allows."""
    cover = (0.5 * (width + pixel) - distance) / pixel
    return min(1.0, width / pixel, max(0.0, cover))


@kernel
def _hump(distance, width):
    """1 in the middle, 0 from `width` on."""
    share = max(0.0, 1.0 - (distance / width) ** 2)
    return share * share


@kernel
def asphalt(x, y, lane, pixel):
    """Grain, wear along the lanes, patches, joints, cracks and manholes.

    Args:
        x: metres, scene frame.
        y: the same.
        lane: (5,) as `lanes.find_lane` fills it.
        pixel: size of a pixel there, metres.

    Returns:
        The tone, by which the surface's colour is multiplied; around 1.
    """
    tone = 1.0 + 0.3 * _layered_noise(0.11 * x, 0.11 * y, 0.11 * pixel)
    tone += 0.3 * _layered_noise(6.0 * x, 6.0 * y, 6.0 * pixel)
    if lane[3] != 0.0:
        tone *= _wear(lane, pixel)
    return tone * _cracks(x, y, pixel)


@kernel
def _cracks(x, y, pixel):
    """Thin cracks, in places where the ground gives way."""
    weak = _smooth_noise(0.07 * x + 31.0, 0.07 * y)
    if weak < 0.5 or pixel > 0.08:
        return 1.0
    line = abs(_layered_noise(0.45 * x, 0.45 * y, 0.0)) / 0.5
    return 1.0 - 0.5 * min(1.0, 5.0 * (weak - 0.5)) * _stripe(line, 0.012, pixel)


@kernel
def _wear(lane, pixel):
    """What wheels and oil leave on a lane; it fades to the sides of ways across junctions."""
    along, across, left, half = lane[0], lane[1], lane[2], abs(lane[3])
    own = int(lane[4] * 65535.0)
    aside = abs(across)
    uneven = 0.5 + _smooth_noise(0.09 * along, 3.7 * own)
    if lane[3] < 0.0:
        uneven *= 1.6 * _hump(aside, half)
    tone = 1.0 + 0.1 * uneven * _hump(abs(aside - _TRACK), _TRACK_WIDTH)
    waiting = 1.0 / (1.0 + left / 9.0)
    spots = max(0.0, 0.8 + 2.0 * _layered_noise(0.7 * along + own, 1.6 * across, 0.7 * pixel))
    tone *= 1.0 - (0.09 + 0.22 * waiting) * uneven * spots * _hump(aside, 0.55)
    return tone * _works(along, across, half, own, pixel) if lane[3] > 0.0 else tone


@kernel
def _works(along, across, half, own, pixel):
    """What was built and mended on a lane: its own tone, joints, sealed cracks, patches, and manholes."""
    tone = 1.0 + 0.16 * (_hashed(own, floor(along / 37.0)) - 0.5)
    tone *= 1.0 - 0.3 * _stripe(abs(half - 0.06 - abs(across)), 0.03, pixel)
    cell = floor(along / 13.0)
    if _hashed(own + 1, cell) < 0.45:
        bend = 1.1 * _layered_noise(0.55 * across + 3.1 * cell, own, 0.0)
        line = along - 13.0 * cell - 6.0 - 4.0 * (_hashed(own + 2, cell) - 0.5) - bend
        tone *= 1.0 - 0.4 * _stripe(abs(line), 0.035, pixel)
    # One piece of six metres in nine was dug up and closed again; it has a sealed rim.
    cell = floor(along / 6.0)
    chance = _hashed(own + 7, cell)
    if chance < 0.11:
        u = along - 6.0 * cell
        width = 0.35 + 0.6 * _hashed(own + 8, cell)
        reach = min(u - 0.4, 0.8 + 4.6 * _hashed(own + 9, cell) - u)
        reach = min(reach, half * width - abs(across - half * (chance * 9.0 - 0.5) * (1.0 - width)))
        if reach > 0.0:
            tone *= 0.78 if chance < 0.08 else 1.13
        tone *= 1.0 - 0.42 * _stripe(abs(reach), 0.05, pixel)
    cell = floor(along / 19.0)
    if _hashed(own + 3, cell) < 0.4:
        u = along - 19.0 * cell - 3.0 - 13.0 * _hashed(own + 4, cell)
        v = across - 0.9 * half * (_hashed(own + 5, cell) - 0.5)
        tone *= _manhole(sqrt(u * u + v * v), u, v, pixel)
    return tone


@kernel
def _manhole(distance, u, v, pixel):
    """An iron cover with knobs, in a ring of concrete."""
    if distance > _COVER + 0.1:
        return 1.0
    if distance > _COVER:
        return 1.25
    knobs = 0.18 * _shown(9.0 * pixel) * ((floor(9.0 * u) + floor(9.0 * v)) % 2)
    return (0.62 + knobs) * (1.0 - 0.45 * _stripe(_COVER - distance, 0.03, pixel))


@kernel
def grass(x, y, pixel):
    """Tufts, and drier and lusher places.

    Args:
        x: metres, scene frame.
        y: the same.
        pixel: size of a pixel there, metres; finer details fade out.

    Returns:
        The tone, by which the surface's colour is multiplied; around 1.
    """
    tone = 1.0 + 0.7 * _layered_noise(0.09 * x, 0.09 * y, 0.09 * pixel)
    return tone + 0.75 * _layered_noise(2.3 * x, 2.3 * y, 2.3 * pixel)


@kernel
def paving(x, y, pixel):
    """Slabs of half a metre with joints, some of them darker, and what people have dropped on them.

    Args:
        x: metres, scene frame.
        y: the same.
        pixel: size of a pixel there, metres; finer details fade out.

    Returns:
        The tone, by which the surface's colour is multiplied; around 1.
    """
    u, v = 2.0 * x, 2.0 * y
    i, j = floor(u), floor(v)
    tone = 1.0 + 0.2 * _shown(2.0 * pixel) * (_hashed(i, j) - 0.5)
    tone += 0.34 * _layered_noise(0.25 * x, 0.25 * y, 0.25 * pixel)
    tone += 0.14 * _layered_noise(5.0 * x, 5.0 * y, 5.0 * pixel)
    edge = 0.5 * min(u - i, 1.0 - (u - i), v - j, 1.0 - (v - j))
    return tone * (1.0 - 0.35 * _stripe(edge, 0.02, pixel))


@kernel
def kerb(along, pixel):
    """Stones of a metre, side by side.

    Args:
        along: metres along the kerb.
        pixel: size of a pixel there, metres.

    Returns:
        The tone, by which the surface's colour is multiplied; around 0.8.
    """
    i = floor(along)
    edge = min(along - i, 1.0 - (along - i))
    return (0.8 + 0.14 * (_hashed(i, 11) - 0.5)) * (1.0 - 0.4 * _stripe(edge, 0.02, pixel))


@kernel
def paint(x, y, lane, pixel):
    """Road paint: dirty, and chipped off where wheels run over it.

    Args:
        x: metres, scene frame.
        y: the same.
        lane: (5,) as `lanes.find_lane` fills it.
        pixel: size of a pixel there, metres; finer details fade out.

    Returns:
        The tone, by which the surface's colour is multiplied; around 0.5, less where the paint is gone.
    """
    dirt = _layered_noise(0.8 * x, 0.8 * y, 0.8 * pixel)
    chips = 1.3 * _layered_noise(7.0 * x, 7.0 * y, 7.0 * pixel) + 0.9 * dirt
    wheels = _hump(abs(abs(lane[1]) - _TRACK), 1.4 * _TRACK_WIDTH) if lane[3] != 0.0 else 0.0
    gone = min(1.0, max(0.0, 3.0 * (chips + 0.32 * wheels - 0.3)))
    return (_WORN_WHITE - 0.25 * max(0.0, dirt) - 0.08 * wheels) * (1.0 - 0.75 * gone)


@kernel
def ballast(x, y, pixel):
    """Crushed stone.

    Args:
        x: metres, scene frame.
        y: the same.
        pixel: size of a pixel there, metres; finer details fade out.

    Returns:
        The tone, by which the surface's colour is multiplied; around 1.
    """
    return 1.0 + 0.9 * _layered_noise(5.0 * x, 5.0 * y, 5.0 * pixel)


@kernel
def gravel(x, y, pixel):
    """What lies on level roofs.

    Args:
        x: metres, scene frame.
        y: the same.
        pixel: size of a pixel there, metres; finer details fade out.

    Returns:
        The tone, by which the surface's colour is multiplied; around 1.
    """
    return 1.0 + 0.5 * _layered_noise(3.0 * x, 3.0 * y, 3.0 * pixel)


@kernel
def tiles(along, z, pixel):
    """Rows of tiles on a pitched roof.

    Args:
        along: metres along the eaves.
        z: height, metres, scene frame.
        pixel: size of a pixel there, metres; finer details fade out.

    Returns:
        The tone, by which the surface's colour is multiplied; around 1.
    """
    row = floor(z / 0.24)
    tile = floor(along / 0.3 + 0.5 * (row % 2))
    tone = 1.0 + 0.22 * _shown(3.0 * pixel) * (_hashed(tile, row) - 0.5)
    tone += 0.3 * _layered_noise(0.5 * along, 0.5 * z, 0.5 * pixel)
    return tone * (1.0 - 0.4 * _stripe(z - 0.24 * row, 0.03, pixel))


@kernel
def facade(along, height, left, slope, ridge, number, pixel):
    """A wall of plaster or brick, boards under the roof, windows and doors, and perhaps shops below.

    No two houses have the same bays. Windows in even bands, as nobody builds them, are taken for a train's.

    Args:
        along: metres along the wall.
        height: metres above the building's foot.
        left: metres to the roof.
        slope: metres by which the roof rises for each metre along the wall.
        ridge: how high the roof's highest place is above the building's foot, metres.
        number: the building's own, from 0 to 1.
        pixel: size of a pixel there, metres.

    Returns:
        The tone, and -1; or where there is a pane of glass how bright is what is behind it, and a number
        from 0 to 1 that is its own.
    """
    own = int(number * 65535.0)
    wall = _wall(along, height, left, own, pixel)
    if left < _EAVES:
        return 1.3, -1.0
    if left < _EAVES + _SHADOW:
        return 0.38 + 0.5 * (left - _EAVES) / _SHADOW, -1.0
    is_shop = height < _GROUND_FLOOR and own % 5 < 2
    bay = _SHOP_BAY if is_shop else _BAY + 0.35 * (own // 8 % 4)
    i = floor(along / bay)
    aside = along - (i + 0.5) * bay
    roof = ridge - abs(ridge - height - left + slope * aside)  # Over the bay's middle; both slopes are alike.
    if is_shop and roof - 0.5 * bay * abs(slope) > _GROUND_FLOOR + 1.5:
        return _shop(along, height, own, wall, pixel)
    if height < 0.6 or pixel > 1.0:
        return wall, -1.0
    if height < _GROUND_FLOOR and (i + own) % 4 == 1:
        return _door(abs(aside), height, wall)
    return _window(abs(aside), i, height, roof, abs(slope), own, wall)


@kernel
def _wall(along, height, left, own, pixel):
    """Plaster that weather has marked, or courses of brick; string courses, downpipes and a darker foot."""
    tone = 1.0 + 0.1 * _layered_noise(0.4 * along, 0.4 * height, 0.4 * pixel)
    tone += 0.1 * _shown(9.0 * pixel) * (_smooth_noise(9.0 * along, 9.0 * height) - 0.5)
    tone += 0.1 * _layered_noise(3.0 * along, 0.5 * height, 3.0 * pixel)
    tone *= 1.0 - 0.12 * max(0.0, 1.0 - 0.5 * left)
    if own % 3 != 1:
        row = floor(height / 0.25)
        place = along / 0.5 + 0.5 * (row % 2)
        stone = floor(place)
        joint = min(height - 0.25 * row, 0.5 * (place - stone))
        tone *= 1.0 + 0.24 * _shown(4.0 * pixel) * (_hashed(stone, row) - 0.5)
        tone *= 1.0 - 0.3 * _stripe(joint, 0.03, pixel)
    course = abs((height - _GROUND_FLOOR) / _FLOOR - floor((height - _GROUND_FLOOR) / _FLOOR + 0.5)) * _FLOOR
    if own // 3 % 2 == 0 and height > _FLOOR:
        tone *= 1.0 + 0.18 * _stripe(course, 0.16, pixel) - 0.3 * _stripe(abs(course - 0.1), 0.04, pixel)
    pipe = abs(along / _PIPE_APART - floor(along / _PIPE_APART) - 0.02 * (own % 50)) * _PIPE_APART
    tone *= 1.0 - 0.45 * _stripe(pipe, 0.1, pixel)
    return 0.72 * tone if height < 0.6 else tone


@kernel
def _door(aside, height, wall):
    """A dark door of two leaves with a light above it, in a frame."""
    if aside > 0.75 or height > 2.75:
        return wall, -1.0
    if aside > 0.62 or height > 2.62:
        return 1.15, -1.0
    if height > 2.15:
        return (1.1, -1.0) if height < 2.2 else (0.0, 0.2)
    return (0.24 if aside < 0.02 or abs(aside - 0.31) > 0.2 else 0.34), -1.0


@kernel
def _window(aside, bay, height, roof, slope, own, wall):
    """A window in its frame, with mullion and transom, over a sill; it may have shutters, or be left out.

    Stairs have theirs half a storey higher. None reaches into the roof, whose height over the window's middle
    and whose slope are known.
    """
    lift = _GROUND_FLOOR - _FLOOR
    if (bay + own // 2) % 6 == 3 and height > _GROUND_FLOOR:
        lift += 0.5 * _FLOOR
    storey = floor((height - lift) / _FLOOR)
    up = height - lift - _FLOOR * storey - _SILL
    half, tall = 0.4 + 0.06 * (own // 32 % 4), 1.3 + 0.15 * (own // 128 % 3)
    reach = half + (0.5 * half + 0.1 if own // 512 % 4 == 0 else _SURROUND)
    is_under = height - up + tall + _SURROUND + _EAVES + 0.2 < roof - slope * reach
    if aside > reach or not -0.14 < up < tall + _SURROUND or _hashed(bay, own) < 0.1 or not is_under:
        return wall, -1.0
    if up < 0.0:
        return (1.2 if up > -0.07 else 0.75 * wall), -1.0
    if aside > half or up > tall:
        shut = reach > half + _SURROUND and aside > half + 0.03 and up < tall
        return (0.42 if shut else 1.22 if own % 2 == 0 else wall), -1.0
    transom = 0.66 * tall if own // 16 % 3 else 2.0 * tall
    if tall - up < _REVEAL:
        return 0.3 * wall, -1.0
    below = tall - _REVEAL - up
    if half - aside < 0.06 or min(up, below) < 0.06 or aside < 0.04 or abs(up - transom) < 0.035:
        return 1.3, -1.0
    pane = _hashed(bay + 31 * own, storey)
    return _curtain(aside / half, up / tall, pane), pane


@kernel
def _curtain(aside, up, pane):
    """How bright is what hangs behind a pane: a blind that is partly down, curtains, or nothing."""
    share = (17.0 * pane) % 1.0
    if share < 0.35:
        return 0.62 if up > 1.0 - 2.2 * share else 0.0
    if share < 0.75:
        return 0.5 - 0.12 * sin(40.0 * aside) if aside > 1.3 - share else 0.0
    return 0.0


@kernel
def _shop(along, height, own, wall, pixel):
    """A shop: a window of panes beside a door, between piers of the wall, under a sign."""
    i = floor(along / _SHOP_BAY)
    place = along - _SHOP_BAY * i
    edge = min(place - 0.45, _SHOP_BAY - 0.45 - place)
    if edge < 0.0 or height > 3.3:
        return wall, -1.0
    if height > 2.65:
        return (0.35 + 0.9 * _hashed(i + own, 5) if height > 2.75 else 0.9 * wall), -1.0
    is_door = 1.35 < place - 1.2 * (own % 3) < 2.45
    if height < (0.12 if is_door else 0.55):
        return 0.7 * wall, -1.0
    post = min(abs(place - 1.2 * (own % 3) - 1.35), abs(place - 1.2 * (own % 3) - 2.45))
    if edge < 0.06 or post < 0.07 or height > 2.55 or abs(height - 2.1) < 0.04:
        return 0.45, -1.0
    return _goods(along, height, own), 0.56 + 0.44 * _hashed(i + 17 * own, 2) if pixel < 1.0 else 0.5


@kernel
def _goods(along, height, own):
    """How bright is what stands in a shop window, piece by piece; above it the shop is dim."""
    i = floor(along / 0.7)
    tall = 0.6 + 1.3 * _hashed(i + own, 13)
    aside = abs(along / 0.7 - i - 0.5)
    if height < tall and aside < 0.25 + 0.2 * _hashed(i + own, 14):
        return 0.15 + 0.75 * _hashed(i + own, floor(2.2 * height) + 15)
    return 0.3 if height < 0.55 else 0.12 * (height > 2.2)


@kernel
def foliage(x, y, z, pixel):
    """Leaves, and the dark between them.

    Args:
        x: metres, scene frame.
        y: the same.
        z: the same.
        pixel: size of a pixel there, metres; finer details fade out.

    Returns:
        The tone, by which the surface's colour is multiplied; around 1, far less between leaves.
    """
    tone = 1.0 + 0.8 * _layered_noise(0.9 * (x + 0.37 * z), 0.9 * (y + 0.61 * z), 0.9 * pixel)
    leaves = _layered_noise(4.5 * (x - 0.43 * z), 4.5 * (y + 0.71 * z), 4.5 * pixel)
    twigs = _layered_noise(9.0 * (x + y), 9.0 * z + 5.0 * (x - y), 9.0 * pixel)
    return (tone + 1.3 * leaves + 2.2 * twigs) * (0.35 if leaves + 0.9 * twigs < -0.12 else 1.0)


@kernel
def ruffle(x, y, z, pixel, normal):
    """Turn the normal of a crown as leaves do: every which way, so that no face is seen as one.

    Args:
        x: metres, scene frame.
        y: the same.
        z: the same.
        pixel: size of a pixel there, metres; where one holds many leaves the normal stays.
        normal: (3,) unit vector, changed in place.
    """
    strength = 1.5 * _shown(2.2 * pixel)
    if strength == 0.0:
        return
    u, v, w = 3.1 * (x + 0.5 * z), 3.1 * (y - 0.5 * z), 2.3 * (z - 0.5 * x + 0.3 * y)
    normal[0] += strength * (_smooth_noise(u, v + 40.0) - 0.5)
    normal[1] += strength * (_smooth_noise(v, w + 80.0) - 0.5)
    normal[2] += strength * (_smooth_noise(w, u) - 0.4)
    length = sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    for axis in range(3):
        normal[axis] /= max(1e-6, length)


@kernel
def clouds(x, y):
    """Share of thin clouds that hides the sky at a place far above.

    Args:
        x: place on the layer of clouds, in multiples of its height over the eye.
        y: the same.

    Returns:
        0 for clear sky to 0.85.
    """
    return min(0.85, max(0.0, 2.2 * _layered_noise(x, y, 0.0) + 0.12))


@kernel
def woods(x, y):
    """How high woods and hills stand over the horizon in a direction, as a share of their distance.

    Args:
        x: of the direction, a level unit vector, scene frame.
        y: the same.

    Returns:
        Height over distance, around 0.016.
    """
    hills = 0.016 + 0.014 * _layered_noise(7.0 * x, 7.0 * y, 0.0)
    return hills + 0.012 * _layered_noise(60.0 * x, 60.0 * y, 0.0)


@kernel
def puddles(x, y, pixel):
    """Share of the sky that wet ground mirrors: little on open grain, all in puddles.

    Args:
        x: metres, scene frame.
        y: the same.
        pixel: size of a pixel there, metres; finer details fade out.

    Returns:
        0.35 to 1.
    """
    level = _layered_noise(0.35 * x + 9.0, 0.35 * y + 3.0, 0.35 * pixel)
    return 0.35 + 0.65 * min(1.0, max(0.0, 0.5 + 6.0 * level))
