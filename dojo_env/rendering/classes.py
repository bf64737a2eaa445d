"""What a pixel can show: the semantic classes, their colours, and the surface each scene layer is made of."""

from enum import IntEnum

import numpy as np

from dojo_env.snapshot import Kind


class Semantic(IntEnum):
    """The class of a pixel or of a lidar return."""

    SKY = 0
    TERRAIN = 1
    ROAD = 2
    SIDEWALK = 3
    CROSSING = 4
    MARKING = 5
    ISLAND = 6
    RAIL = 7
    BUILDING = 8
    TREE = 9
    WATER = 10
    SIGNAL = 11
    CAR = 12
    BUS = 13
    TRUCK = 14
    TRAM = 15
    MOTORCYCLE = 16
    BICYCLE = 17
    PEDESTRIAN = 18
    SHIP = 19


class Surface(IntEnum):
    """What a static face is made of; decides its texture."""

    PLAIN = 0
    GRASS = 1
    ASPHALT = 2
    PAVING = 3
    PAINT = 4
    BALLAST = 5
    FACADE = 6
    FOLIAGE = 7
    WATER = 8
    METAL = 9
    GLASS = 10


LAYERS = {
    "terrain": (Semantic.TERRAIN, Surface.GRASS, (104, 128, 78)),
    "road": (Semantic.ROAD, Surface.ASPHALT, (92, 91, 89)),
    "road/parking": (Semantic.ROAD, Surface.ASPHALT, (104, 103, 101)),
    "junction": (Semantic.ROAD, Surface.ASPHALT, (90, 89, 87)),
    "rail": (Semantic.RAIL, Surface.BALLAST, (112, 101, 90)),
    "sidewalk": (Semantic.SIDEWALK, Surface.PAVING, (168, 164, 156)),
    "walking_area": (Semantic.SIDEWALK, Surface.PAVING, (172, 167, 158)),
    "island": (Semantic.ISLAND, Surface.GRASS, (134, 142, 112)),
    "marking": (Semantic.MARKING, Surface.PAINT, (232, 232, 226)),
    "crossing": (Semantic.CROSSING, Surface.PAINT, (236, 236, 232)),
    "stop_line": (Semantic.MARKING, Surface.PAINT, (236, 236, 232)),
    "arrow": (Semantic.MARKING, Surface.PAINT, (234, 234, 228)),
    "signal": (Semantic.SIGNAL, Surface.METAL, (52, 56, 60)),
    "building": (Semantic.BUILDING, Surface.FACADE, (196, 182, 164)),
    "building/lamp": (Semantic.BUILDING, Surface.METAL, (112, 116, 120)),
    "building/sign": (Semantic.BUILDING, Surface.METAL, (140, 142, 144)),
    "building/sign/rim": (Semantic.BUILDING, Surface.PLAIN, (196, 40, 36)),
    "building/sign/face": (Semantic.BUILDING, Surface.PLAIN, (240, 240, 238)),
    "building/shelter": (Semantic.BUILDING, Surface.METAL, (86, 92, 98)),
    "building/shelter/glass": (Semantic.BUILDING, Surface.GLASS, (190, 206, 210)),
    "tree": (Semantic.TREE, Surface.FOLIAGE, (66, 104, 52)),
    "tree/hedge": (Semantic.TREE, Surface.FOLIAGE, (58, 94, 46)),
    "tree/leaves": (Semantic.TREE, Surface.FOLIAGE, (78, 118, 58)),
    "tree/trunk": (Semantic.TREE, Surface.PLAIN, (92, 74, 58)),
    "terrain/green": (Semantic.TERRAIN, Surface.GRASS, (92, 122, 66)),
    "terrain/water": (Semantic.WATER, Surface.WATER, (70, 100, 120)),
}
"""Semantic class, surface and sRGB colour by node of scene.glb, or by its layer."""
OTHER_LAYER = (Semantic.BUILDING, Surface.PLAIN, (150, 150, 150))

SEMANTIC_OF_KIND = np.array(
    [
        {
            Kind.BUS: Semantic.BUS,
            Kind.COACH: Semantic.BUS,
            Kind.ARTICULATED_BUS: Semantic.BUS,
            Kind.TRUCK: Semantic.TRUCK,
            Kind.TRAILER: Semantic.TRUCK,
            Kind.ROAD_TRAIN: Semantic.TRUCK,
            Kind.FIRE_ENGINE: Semantic.TRUCK,
            Kind.TRAM: Semantic.TRAM,
            Kind.TRAIN: Semantic.TRAM,
            Kind.MOTORCYCLE: Semantic.MOTORCYCLE,
            Kind.SCOOTER: Semantic.MOTORCYCLE,
            Kind.MOPED: Semantic.MOTORCYCLE,
            Kind.BICYCLE: Semantic.BICYCLE,
            Kind.PEDESTRIAN: Semantic.PEDESTRIAN,
            Kind.WHEELCHAIR: Semantic.PEDESTRIAN,
            Kind.PRAM: Semantic.PEDESTRIAN,
            Kind.SHIP: Semantic.SHIP,
        }.get(kind, Semantic.CAR)
        for kind in Kind
    ],
    dtype=np.uint8,
)
"""Semantic class by `Kind`."""

SEMANTIC_COLOURS = np.array(
    [
        (135, 190, 235), (126, 160, 96), (96, 74, 120), (232, 150, 220), (250, 250, 250), (214, 214, 120),
        (170, 190, 150), (140, 120, 100), (120, 120, 130), (60, 130, 60), (60, 110, 180), (250, 170, 30),
        (40, 70, 220), (20, 150, 170), (70, 30, 130), (0, 200, 120), (230, 60, 30), (160, 20, 40),
        (220, 20, 60), (90, 160, 220),
    ],
    dtype=np.uint8,
)  # fmt: skip
"""sRGB by `Semantic`, for people to look at."""
