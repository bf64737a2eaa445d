"""What a labelled picture costs: processor time by format, with light, weather and labels as users get them.

    python tools/bench_dataset.py [-n 4000] [--formats coco mot] [--imaging traffic_camera]

Episodes are simulated, drawn, labelled and written in this process and the forks that run SUMO; the time of
both counts. Each format's kernels and maps are loaded before. Pictures an hour are those of two cores.
"""

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path

import cv2

from dojo_env.datasets.formats import FORMATS
from dojo_env.datasets.parts import make_part
from dojo_env.datasets.settings import DatasetSettings, Plan
from dojo_maps.whole_file import write_json

GOAL, CORES = 300_000, 2
_WARM = 8
"""Pictures that are made first, uncounted."""


def make_pictures(settings: DatasetSettings) -> tuple[float, float]:
    """Make a data set's parts; returns processor seconds a picture, all and those of SUMO's forks."""
    before = os.times()
    with tempfile.TemporaryDirectory() as folder:
        for job in Plan(settings=settings).jobs:
            part = Path(folder) / job.name
            part.mkdir()
            make_part(settings, job, part)
            shutil.rmtree(part)
    own, forked = (
        sum(now - then for now, then in zip(os.times()[k : k + 2], before[k : k + 2], strict=True))
        for k in (0, 2)
    )
    return (own + forked) / settings.pictures, forked / settings.pictures


def main() -> int:
    """Print a table, and write it as JSON where asked."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenarios", nargs="*", default=["cologne1"])
    parser.add_argument("-n", type=int, default=4000, help="pictures of each format (default: 4000)")
    parser.add_argument("--formats", nargs="+", default=list(FORMATS), choices=list(FORMATS))
    parser.add_argument("--conditions", nargs="+", default=["random"])
    parser.add_argument("--imaging", nargs="+", default=["ideal"])
    parser.add_argument("--depth", action="store_true")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    print(f"{'format':8}{'ms a picture':>14}{'of them SUMO':>14}{'pictures an hour':>18}")
    rows = []
    for name in options.formats:
        made = {
            "scenarios": tuple(options.scenarios), "format": name, "split": (1.0,), "depth": options.depth,
            "conditions": tuple(options.conditions), "imaging": tuple(options.imaging),
        }  # fmt: skip
        make_pictures(DatasetSettings(pictures=_WARM, per_episode=_WARM, **made))
        each, simulated = make_pictures(
            DatasetSettings(pictures=options.n, per_episode=min(1000, options.n), **made)
        )
        hourly = CORES * 3600 / each
        rows.append({"format": name, "seconds": each, "simulated": simulated, "hourly": hourly})
        print(f"{name:8}{1000 * each:14.1f}{1000 * simulated:14.1f}{hourly:18,.0f}", flush=True)
    for row in rows:
        word = "holds " if row["hourly"] >= GOAL else "MISSED"
        print(f"{word}  {row['format']}: {row['hourly']:,.0f} an hour, goal {GOAL:,}")
    if options.json:
        write_json(options.json, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
