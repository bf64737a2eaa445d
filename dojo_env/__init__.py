"""The environment: SUMO's traffic on a converted map, seen through cameras, measured and controlled.

Reads maps only through `dojo_maps.bundle`.
"""
