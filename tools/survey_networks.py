"""Convert every network of a folder; print each one's status, seconds and last line, and what was lost.

A network is lost where SUMO loads it and no bundle comes of it. Exits with 1 if any is.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def main() -> int:
    """Survey a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="searched for .net.xml and .net.xml.gz")
    parser.add_argument("--export", nargs="*", default=[], help="formats to write, too")
    parser.add_argument("--patience", type=float, default=120.0, help="seconds for each program")
    options = parser.parse_args()
    extra = ["--export", *options.export] if options.export else []
    lost = []
    for network in sorted([*options.folder.rglob("*.net.xml"), *options.folder.rglob("*.net.xml.gz")]):
        begin = time.monotonic()
        status, said = _convert(network, extra, options.patience)
        note = ""
        if status not in (0, 1):
            loads = _loads(network, options.patience)
            note = " SUMO loads it" if loads else " SUMO does not load it"
            lost += [network.name] * loads
        print(f"{network.name}\t{status}{note}\t{time.monotonic() - begin:.1f} s\t{said}", flush=True)
    print(f"lost: {len(lost)} {' '.join(lost)}")
    return int(bool(lost))


def _convert(network: Path, extra: list[str], patience: float) -> tuple[int, str]:
    """Convert one network; returns the status, -1 if it took too long, and the last line said."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "dojo_maps.cli", "convert", str(network), "--quiet", *extra]
        command += ["-o", f"{folder}/x.dojo", "--jobs", "1"]
        try:
            done = subprocess.run(  # noqa: S603 - this project's own command
                command, capture_output=True, text=True, timeout=patience, check=False
            )
        except subprocess.TimeoutExpired:
            return -1, f"not done after {patience:.0f} s"
    return done.returncode, (done.stderr or done.stdout).strip().replace(f"{folder}/", "").split("\n")[-1]


def _loads(network: Path, patience: float) -> bool:
    """Tell whether SUMO loads a network, within some seconds."""
    sumo = shutil.which("sumo")
    if sumo is None:
        raise SystemExit("sumo is not installed; pip install eclipse-sumo")
    command = [sumo, "-n", str(network), "--end", "1", "--no-step-log"]
    try:
        done = subprocess.run(command, capture_output=True, timeout=patience, check=False)  # noqa: S603 - SUMO
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


if __name__ == "__main__":
    sys.exit(main())
