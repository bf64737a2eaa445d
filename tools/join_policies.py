"""Put policies for any junction side by side: one whose scores are the sums of theirs.

The policy `learned` that ships with the package is two trainings with different seeds, joined so.

    python tools/join_policies.py runs/one runs/other --out both.npz
"""

import argparse
import sys
from pathlib import Path

from dojo_env.learning.universal.joining import join_policies
from dojo_env.learning.universal.training import read_start, write_weights


def main() -> int:
    """Join, and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("policies", nargs="+", metavar="POLICY", help="`learned`, files, or runs' folders")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE")
    options = parser.parse_args()
    write_weights(join_policies([read_start(name) for name in options.policies]), options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
