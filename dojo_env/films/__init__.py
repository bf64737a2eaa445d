"""Films of real cameras: read frame by frame, measured lane by lane, with what a controller would do.

Films that we make are written by `watching.video`.
"""
