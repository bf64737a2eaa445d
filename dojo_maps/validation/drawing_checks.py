"""What could not be drawn as it is described: found while the source is read and while the scene is built."""

from dojo_maps.validation.check import ERROR, WARNING, Check

CHECKS = (
    Check(
        id="geometry.unusable_value",
        code="GEO018",
        title="Every value is one that a street can have",
        severity=ERROR,
        limit="widths of 0.01 to 1000 m, no negative speeds and lengths, positions within 500 km",
        source="SUMO loads others and takes its defaults for some",
        hint="give it a value that a street can have, then rebuild with netconvert",
    ),
    Check(
        id="geometry.uncut_surface",
        code="GEO019",
        title="Every surface is cut along its neighbours",
        severity=WARNING,
        limit="none",
        source="scene.glb: no two surfaces cover the same ground",
        hint="look for an outline that crosses or touches itself there, and draw it anew in netedit",
    ),
)
