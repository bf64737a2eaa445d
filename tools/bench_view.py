"""Measure the 3D page in a browser that draws on the processor: its size, its first picture, its frames.

Frames are those of an eye that circles the first signal, at 1280 x 720 pixels. Beside the time that passed
stands the processor time of all the browser's processes, which a busy machine does not stretch.

    python tools/bench_view.py cologne8.dojo [--recording FILE] [--frames 100]
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from dojo_maps.command import Parser, run_command
from dojo_maps.interruption import begin

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

_CIRCLE = """new Promise(done => {
  const {view} = dojoView, at = view.controls.target.clone(), eye = view.camera.position.clone().sub(at);
  const begin = performance.now(), first = view.frames;
  view.beforeDraw.push(() => {
    const k = view.frames - first, turn = k * Math.PI / 180;
    if (k > FRAMES) return false;
    if (k === FRAMES) { done([(performance.now() - begin) / 1000, view.ratio]); return false; }
    const [c, s] = [Math.cos(turn), Math.sin(turn)];
    view.camera.position.set(at.x + c * eye.x - s * eye.y, at.y + s * eye.x + c * eye.y, at.z + eye.z);
    view.controls.update();
    return true;
  });
  view.request();
})"""


def main() -> int:
    """Measure; see `dojo_maps.command`."""
    return run_command("bench_view", _parser, None)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="bench_view", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("bundles", nargs="+", type=Path, metavar="BUNDLE")
    parser.add_argument("--recording", type=Path, metavar="FILE", help="of the only bundle")
    parser.add_argument("--frames", type=int, default=100)
    parser.set_defaults(run=_bench)
    return parser


def _bench(options: argparse.Namespace) -> int:
    print(f"{'map':16} {'page':>8} {'first picture':>22} {'a frame':>20} {'frames/s':>9} {'ratio':>6}")
    for bundle in options.bundles:
        _bench_one(bundle, options)
    return 0


def _bench_one(bundle: Path, options: argparse.Namespace) -> None:
    from browser import WITH_GL, Browser

    from dojo_env.playback import read_playback
    from dojo_maps.bundle import read_bundle
    from dojo_maps.viewer import write_view

    with tempfile.TemporaryDirectory() as work:
        page = Path(work) / "view.html"
        shown = read_bundle(bundle)
        playback = read_playback(options.recording, shown.road_map) if options.recording else None
        write_view(shown.road_map, shown.read_meshes(), page, playback=playback)
        with Browser(page.as_uri(), Path(work) / "profile", size=(1280, 720), flags=WITH_GL) as browser:
            first = browser.wait(lambda: browser.run("document.documentElement?.dataset.firstPicture"))
            used = _processor_seconds()
            time.sleep(1.0)
            before = _processor_seconds()
            seconds, ratio = browser.run(_CIRCLE.replace("FRAMES", str(options.frames)))
            each = (_processor_seconds() - before) / options.frames
        size = page.stat().st_size / 1e6
        print(
            f"{bundle.stem:16} {size:5.1f} MB {float(first) / 1000:6.1f} s, processor {used:3.1f} s "
            f"{seconds / options.frames * 1000:5.0f} ms, cpu {each * 1000:4.0f} ms "
            f"{options.frames / seconds:9.1f} {ratio:6.2f}"
        )


def _processor_seconds() -> float:
    """Add up the processor time of all processes that this one has begun, and of theirs."""
    parents, ticks = {}, {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and (entry / "stat").exists():
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
            parents[int(entry.name)], ticks[int(entry.name)] = (
                int(fields[1]),
                int(fields[11]) + int(fields[12]),
            )
    ours = {os.getpid()}
    while grown := {child for child, parent in parents.items() if parent in ours} - ours:
        ours |= grown
    return sum(ticks[pid] for pid in ours - {os.getpid()}) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    begin("bench_view: interrupted")
    main()
