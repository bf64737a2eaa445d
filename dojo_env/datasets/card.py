"""The card of a data set: what is in it, counted, and how it was made, for people and for programs."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from dojo_env.conditions import Conditions
from dojo_env.datasets.labels import Category, ObjectLabel, PictureLabels
from dojo_env.datasets.settings import CAMERA, EPISODE, SCENARIO

Counts = dict[str, dict[str, int]]
"""Numbers by what is counted, and by its values."""

HEIGHTS = (16, 24, 32, 48, 64, 96, 128, 192)
"""Bounds of the bins of box heights, pixels."""
_TITLES = {
    "pictures by split": "split",
    "pictures by scenario": "scenario",
    "pictures by camera": "camera",
    "pictures by light": "light",
    "pictures by weather": "weather",
    "pictures by controller": "who set the signals",
    "objects by category": "category",
    "objects by place": "where it is",
    "objects by height": "height of the box, pixels",
    "objects by occlusion": "visible share",
    "objects by truncation": "share outside of the picture",
    "objects by light": "light",
    "objects by weather": "weather",
    "objects by movement": "movement at the next junction",
    "objects by signal": "letter of their signal's link",
}
"""Tables of the card, and the heads of their first columns."""
_DIVIDED = {
    EPISODE: "The cameras are the same in all.",
    SCENARIO: "No scenario is in two of them, either.",
    CAMERA: "No camera is in two of them, either.",
}
_EXPLANATION = (
    "Pictures are drawn, not photographed: traffic is SUMO's, streets come from the map. Boxes hold the "
    "visible pixels unless the format says otherwise; riders belong to their bicycles and motorcycles.",
    "",
    "`labels.jsonl` holds all that is known, a line per picture: the camera's K, R, t and lens (a point X of "
    "the map is at K (R X + t)), light and weather, SUMO's time and seed, the letters of each signal; and of "
    "each road user its boxes in the picture and in space, its mask (COCO's compressed run lengths), the "
    "keypoints of vehicles (corners of the box in space, wheels, lamps), its track (unique within its "
    "episode), visible share, truncation, whether it is parked, speed, lane, movement, and the signal's link "
    "that it comes to.",
)
_OCCLUSIONS = ("0: 90 % and more", "1: 50 to 90 %", "2: less than 50 %")
_CUT = 0.02


def count_pictures(pictures: Iterable[PictureLabels]) -> Counts:
    """Count what is in pictures; road users that are not asked for are counted apart.

    Args:
        pictures: of any splits and scenarios.

    Returns:
        What a card tells: `totals`, `boxes` by category, height and occlusion, and the card's tables.
    """
    counts: dict[str, Counter[str]] = {name: Counter() for name in ("totals", "boxes", *_TITLES)}
    for picture in pictures:
        light, weather = tell_light(picture.conditions), tell_weather(picture.conditions)
        counts["totals"].update(pictures=1, empty_pictures=int(picture.is_empty), objects=0, ignored=0)
        camera = f"{picture.scenario}: {picture.camera.name}"
        for name, value in (
            ("split", picture.split), ("scenario", picture.scenario), ("camera", camera), ("light", light),
            ("weather", weather), ("controller", picture.controller),
        ):  # fmt: skip
            counts[f"pictures by {name}"][value] += 1
        for each in picture.objects:
            if each.is_ignored:
                counts["totals"]["ignored"] += 1
                continue
            counts["totals"].update(objects=1, pixels=each.pixels)
            for name, value in _values(each, light, weather):
                counts[f"objects by {name}"][value] += 1
            counts["boxes"][f"{each.category.value} | {_bin(each)} | {each.occlusion}"] += 1
    return {name: dict(sorted(found.items())) for name, found in counts.items()}


def add_counts(parts: Iterable[Mapping[str, Mapping[str, int]]]) -> Counts:
    """Add up the counts of parts.

    Args:
        parts: of each what `count_pictures` gives.

    Returns:
        The counts of all of them, as `count_pictures` gives them.
    """
    total: dict[str, Counter[str]] = {}
    for part in parts:
        for name, found in part.items():
            total.setdefault(name, Counter()).update(found)
    return {name: dict(sorted(found.items())) for name, found in total.items()}


def tell_light(conditions: Conditions) -> str:
    """Name the light of an hour.

    Args:
        conditions: only the hour counts.

    Returns:
        `day`, `dusk or dawn` or `night`.
    """
    if 7.0 <= conditions.hour <= 18.5:
        return "day"
    return "dusk or dawn" if 5.0 <= conditions.hour <= 21.0 else "night"


def tell_weather(conditions: Conditions) -> str:
    """Name a weather.

    Args:
        conditions: rain counts before fog, and that before clouds.

    Returns:
        `rain`, `fog`, `overcast` or `clear`.
    """
    if conditions.rain > 0.05:
        return "rain"
    if conditions.fog > 0.002:
        return "fog"
    return "overcast" if conditions.overcast > 0.5 else "clear"


def _values(label: ObjectLabel, light: str, weather: str) -> Sequence[tuple[str, str]]:
    share = label.truncated
    return (
        ("category", label.category.value),
        ("place", "parked" if label.is_parked else "on the road"),
        ("height", _bin(label)),
        ("occlusion", _OCCLUSIONS[label.occlusion]),
        ("truncation", "none" if share < _CUT else "up to a half" if share < 0.5 else "more than half"),
        ("light", light),
        ("weather", weather),
        ("movement", label.movement or "not known"),
        ("signal", "none" if label.link is None else label.link.state),
    )


def _bin(label: ObjectLabel) -> str:
    """Name the bin of a box's height, such that names sort as heights do."""
    height = label.box[3] - label.box[1]
    bounds = (0, *HEIGHTS)
    low = max(bound for bound in bounds if bound <= height)
    at = bounds.index(low) + 1
    return f"{low:3d} to {bounds[at] - 1}" if at < len(bounds) else f"{low:3d} and more"


def write_card(facts: Mapping[str, Any], counts: Counts) -> str:
    """Write the card in Markdown.

    Args:
        facts: `settings`, `command`, `versions` and `scenarios` of the data set.
        counts: of all of it.

    Returns:
        The card's text.
    """
    settings, totals = facts["settings"], counts["totals"]
    name = ", ".join(each["name"] for each in facts["scenarios"])
    lines = [
        "---",
        "license: other",
        "task_categories: [object-detection, image-segmentation, keypoint-detection, depth-estimation]",
        f"pretty_name: Simulated traffic of {name}",
        "---",
        "",
        f"# Simulated traffic of {name}",
        "",
        f"{totals['pictures']:,} pictures with {totals['objects']:,} labelled road users, format "
        f"{settings['format']}. {totals['empty_pictures']:,} pictures show empty roads. Of "
        f"{totals['ignored']:,} more road users too little shows (fewer than {settings['least_pixels']} "
        f"pixels, or less than {settings['least_visible']:.0%}): they are marked to be ignored, or left out.",
        "",
        "```",
        facts["command"],
        "```",
        "",
        f"Made with {', '.join(f'{name} {version}' for name, version in facts['versions'].items())}. The "
        "same command, files and versions give the same bytes.",
        "",
        *_EXPLANATION,
        "",
        "Whole episodes are divided among the splits, so no moment of traffic is in two of them. "
        f"{_DIVIDED[settings['split_by']]}",
        "",
        "## Sources",
        "",
        "| scenario | map's SHA-256 | licence of map and demand |",
        "|---|---|---|",
        *(
            f"| {_cell(each['name'])} | {each['map_sha256'][:16]} | {_cell(each['licence'] or 'not known')} |"
            for each in facts["scenarios"]
        ),
        "",
        "## What is in it",
    ]
    for title, head in _TITLES.items():
        lines += ["", f"| {head} | {title.partition(' ')[0]} |", "|---|---:|"]
        lines += [f"| {_cell(value)} | {count:,} |" for value, count in counts[title].items()]
    return "\n".join([*lines, "", *_write_boxes(counts), ""])


def _write_boxes(counts: Counts) -> list[str]:
    """Write a table of categories by height."""
    found: Counter[tuple[str, str]] = Counter()
    for name, count in counts["boxes"].items():
        category, height, _ = name.split(" | ")
        found[category, height] += count
    heights = sorted({height for _, height in found})
    lines = [f"| pixels high | {' | '.join(heights)} |", f"|---|{'---:|' * len(heights)}"]
    for category in Category:
        row = [found[category.value, height] for height in heights]
        if any(row):
            lines.append(f"| {category.value} | {' | '.join(f'{count:,}' for count in row)} |")
    return lines


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
