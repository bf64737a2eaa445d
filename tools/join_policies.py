"""Put policies for any junction side by side: one whose scores are the sums of theirs.

The policy `learned` that ships with the package is two trainings with different seeds, joined so, with
`--delay 1.5`.

    python tools/join_policies.py runs/one runs/other --out both.npz
    python tools/join_policies.py runs/one --delay 1.5 --out ahead.npz
"""

import argparse
import sys
from pathlib import Path

from dojo_env.learning.universal.joining import join_policies
from dojo_env.learning.universal.training import read_start, write_weights
from dojo_env.phase_features import DELAY, PHASE_FEATURES


def main() -> int:
    """Join, and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("policies", nargs="+", metavar="POLICY", help="`learned`, files, or runs' folders")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE")
    parser.add_argument(
        "--delay",
        type=float,
        default=0.0,
        metavar="W",
        help="what a second of waiting ahead takes off a score",
    )
    options = parser.parse_args()
    joined = join_policies([read_start(name) for name in options.policies])
    joined["rule_weight"][0, PHASE_FEATURES.index("delay")] -= options.delay * DELAY
    write_weights(joined, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
