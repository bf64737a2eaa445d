"""The command line against broken, hostile and absurd input: a clear line, the right status, nothing left."""

import contextlib
import gzip
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import pytest
from conftest import Conversion, command_environment, dojo_maps, read_strict_json
from damage import DAMAGES, ENDLESS, LARGE, ODDITIES, damage, network_of, replaced
from scene_reader import read_gltf_json

from dojo_maps.cli import main

pytestmark = pytest.mark.sampled(1)

BUNDLE = {"map.json", "scene.glb", "network.net.xml", "report.json", "report.html", "overview.png"}
TIME_LIMIT = 60.0
MEMORY_LIMIT = 2 << 30
INTERRUPTIONS = (signal.SIGINT, signal.SIGTERM)


@dataclass(frozen=True)
class Bench:
    """An empty place to convert in, which also holds the program's temporary files."""

    folder: Path

    @property
    def temporary(self) -> Path:
        return self.folder / "temporary"

    @property
    def output(self) -> Path:
        return self.folder / "work" / "out.dojo"

    def write(self, name: str, data: bytes) -> Path:
        path = self.folder / "input" / name
        path.write_bytes(data)
        return path

    def convert(self, *arguments: object) -> subprocess.CompletedProcess[str]:
        return dojo_maps(
            "convert",
            *arguments,
            cwd=self.folder / "work",
            env=command_environment(TMPDIR=str(self.temporary)),
            timeout=TIME_LIMIT,
        )

    def left_behind(self) -> set[str]:
        """Everything in the working folder and the temporary folder."""
        return {path.name for name in ("work", "temporary") for path in (self.folder / name).iterdir()}


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    for name in ("input", "work", "temporary"):
        (tmp_path / name).mkdir()
    return Bench(tmp_path)


@pytest.fixture(scope="session")
def good(network_path: Callable[[str], Path]) -> bytes:
    """The bytes of a small network without anything wrong in it."""
    return network_path("bare").read_bytes()


def check_refused(done: subprocess.CompletedProcess[str], *statuses: int) -> None:
    """One line on standard error that can be read, nothing on standard output, and the right status."""
    assert done.returncode in statuses, (done.returncode, done.stderr[-500:])
    assert "Traceback" not in done.stderr
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr[-2000:]
    assert 10 <= len(lines[0]) <= 1000
    assert lines[0].isprintable()
    assert done.stdout == ""


def check_refused_input(bench: Bench, path: object, *statuses: int) -> None:
    check_refused(bench.convert(path, "-o", bench.output), *(statuses or (3,)))
    assert bench.left_behind() == set()


def snapshot(folder: Path) -> dict[str, bytes | None]:
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


NOT_NETWORKS: dict[str, bytes] = {
    "empty": b"",
    "one_byte": b"<",
    "whitespace": b" \n\t\n  ",
    "plain_text": b"This is not a network.\n",
    "json": b'{"net": {"edge": []}}',
    "zeros": bytes(5000),
    "noise": random.Random(1).randbytes(5000),  # noqa: S311 - any bytes will do
    "png": b"\x89PNG\r\n\x1a\n" + bytes(100),
    "html": b"<!DOCTYPE html><html><body><p>404 Not found<br></body></html>",
    "routes": b'<?xml version="1.0"?><routes><vType id="a"/><flow id="f" begin="0" end="9"/></routes>',
    "osm": b'<osm version="0.6"><node id="1" lat="50.9" lon="6.9"/><way id="2"><nd ref="1"/></way></osm>',
    "additional": b'<additional><tlLogic id="a" programID="0" type="static"/></additional>',
    "plain_edges": b'<edges><edge id="a" from="b" to="c" numLanes="1"/></edges>',
    "other_net": b'<net xmlns="http://www.example.org/petri"><place id="p"/></net>',
    "empty_net": b'<net version="1.20"></net>',
    "net_inside": b'<nets><net version="1.20"><edge id="a" from="b" to="c"/></net></nets>',
    "two_roots": b'<net version="1.20"></net><net version="1.20"></net>',
    "unclosed": b'<net version="1.20"><edge id="a"',
    "utf16_without_mark": '<net version="1.20"/>'.encode("utf-16-le"),
}


@pytest.mark.parametrize("name", NOT_NETWORKS)
def test_convert_refuses_what_is_not_a_network(name: str, bench: Bench) -> None:
    check_refused_input(bench, bench.write("input.net.xml", NOT_NETWORKS[name]))


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.95, 0.9999])
def test_convert_refuses_a_truncated_network(share: float, good: bytes, bench: Bench) -> None:
    check_refused_input(bench, bench.write("cut.net.xml", good[: int(share * len(good.rstrip()))]))


ENCODINGS: dict[str, Callable[[bytes], bytes]] = {
    "latin1_called_utf8": lambda good: good.replace(b"<net ", b'<net note="Stra\xdfe" ', 1),
    "unknown_name": lambda good: good.replace(b'encoding="UTF-8"', b'encoding="klingon-7"', 1),
    "utf16_called_utf8": lambda good: good.decode().encode("utf-16-be"),
    "null_byte": lambda good: good.replace(b"<net ", b"<net \0", 1),
    "control_character": lambda good: good.replace(b"<net ", b'<net note="\x1b[31m" ', 1),
    "broken_utf8": lambda good: good.replace(b"<net ", b'<net note="\xff\xfe" ', 1),
    "lone_surrogate": lambda good: good.replace(b"<net ", b'<net note="&#xD800;" ', 1),
    "undefined_entity": lambda good: good.replace(b"<net ", b'<net note="&eacute;" ', 1),
}


@pytest.mark.parametrize("name", ENCODINGS)
def test_convert_refuses_a_wrong_encoding(name: str, good: bytes, bench: Bench) -> None:
    damaged = ENCODINGS[name](good)
    assert damaged != good
    check_refused_input(bench, bench.write("input.net.xml", damaged))


@pytest.mark.parametrize("encoding", ["ISO-8859-1", "UTF-16", "utf-8-sig"])
def test_convert_reads_an_encoding_that_is_declared(encoding: str, good: bytes, bench: Bench) -> None:
    declared = "UTF-8" if encoding == "utf-8-sig" else encoding
    text = good.decode().replace('encoding="UTF-8"', f'encoding="{declared}"')
    text = text.replace('<edge id="e" ', '<edge id="e" name="Größe" ', 1)
    path = bench.write("input.net.xml", text.encode(encoding))
    done = bench.convert(path, "-o", bench.output)
    if done.returncode == 3 and encoding == "UTF-16":
        return  # refusing a rare encoding is fair, as long as it is said
    assert done.returncode in {0, 1}, done.stderr
    names = {road["id"]: road["name"] for road in read_strict_json(bench.output / "map.json")["roads"]}
    assert names["e"] == "Größe"


def _gzip_member(data: bytes) -> bytes:
    return gzip.compress(data, mtime=0)


PACKED: dict[str, Callable[[bytes], bytes]] = {
    "not_packed": lambda good: good,
    "empty": lambda _: b"",
    "empty_content": lambda _: _gzip_member(b""),
    "header_only": lambda good: _gzip_member(good)[:10],
    "truncated": lambda good: _gzip_member(good)[:-200],
    "without_checksum": lambda good: _gzip_member(good)[:-8],
    "wrong_checksum": lambda good: _gzip_member(good)[:-8] + bytes(8),
    "damaged_middle": lambda good: _gzip_member(good)[:800] + bytes(60) + _gzip_member(good)[860:],
    "rubbish_behind": lambda good: _gzip_member(good) + b"rubbish behind the end",
    "packed_rubbish": lambda _: _gzip_member(b"not a network at all"),
    "packed_twice": lambda good: _gzip_member(_gzip_member(good)),
}


@pytest.mark.parametrize("name", PACKED)
def test_convert_refuses_broken_gzip(name: str, good: bytes, bench: Bench) -> None:
    path = bench.write("input.net.xml.gz", PACKED[name](good))
    done = bench.convert(path, "-o", bench.output)
    if name in {"not_packed", "rubbish_behind"} and done.returncode in {0, 1}:
        # Taking the network that is plainly there is as good as refusing a misleading name.
        assert (bench.output / "network.net.xml").read_bytes() == good
        return
    check_refused(done, 3)
    assert bench.left_behind() == set()


def test_convert_reads_gzip_in_several_members(good: bytes, bench: Bench) -> None:
    path = bench.write("input.net.xml.gz", _gzip_member(good[:5000]) + _gzip_member(good[5000:]))
    assert bench.convert(path, "-o", bench.output).returncode in {0, 1}
    assert (bench.output / "network.net.xml").read_bytes() == good


def _measured(bench: Bench, path: Path) -> tuple[int, str, float, int]:
    """Convert and tell the status, standard error, seconds and peak memory of that one process."""
    errors = bench.folder / "errors.txt"
    started = time.monotonic()
    with errors.open("wb") as stream:
        process = subprocess.Popen(
            [sys.executable, "-m", "dojo_maps.cli", "convert", path, "-o", bench.output],
            stdout=subprocess.DEVNULL,
            stderr=stream,
            cwd=bench.folder / "work",
            env=command_environment(TMPDIR=str(bench.temporary)),
        )
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    seconds = time.monotonic() - started
    return process.returncode, errors.read_text(encoding="utf-8"), seconds, usage.ru_maxrss * 1024


def check_bomb_is_refused(bench: Bench, path: Path) -> None:
    status, errors, seconds, memory = _measured(bench, path)
    assert status == 3, errors[-500:]
    assert len(errors.strip().splitlines()) == 1
    assert "Traceback" not in errors
    assert seconds < TIME_LIMIT
    assert memory < MEMORY_LIMIT
    assert bench.left_behind() == set()


def _bomb(start: bytes, filling: bytes, end: bytes, size: int) -> Iterator[bytes]:
    """Pack a text whose middle repeats until it has a size, packing that middle only once."""
    head = zlib.compressobj(9, zlib.DEFLATED, -15)
    yield b"\x1f\x8b\x08\x00\x00\x00\x00\x00\x02\xff"
    yield head.compress(start) + head.flush(zlib.Z_FULL_FLUSH)
    body = zlib.compressobj(9, zlib.DEFLATED, -15)
    chunk = body.compress(filling) + body.flush(zlib.Z_FULL_FLUSH)
    count = size // len(filling)
    yield from (chunk for _ in range(count))
    tail = zlib.compressobj(9, zlib.DEFLATED, -15)
    yield tail.compress(end) + tail.flush()
    checksum = zlib.crc32(start)
    for _ in range(count):
        checksum = zlib.crc32(filling, checksum)
    total = len(start) + count * len(filling) + len(end)
    yield zlib.crc32(end, checksum).to_bytes(4, "little") + (total & 0xFFFFFFFF).to_bytes(4, "little")


BOMBS: dict[str, tuple[bytes, bytes, bytes, int]] = {
    "spaces": (b'<net version="1.20">', b" " * (1 << 20), b"</net>", 2 << 30),
    "attribute": (b'<net version="1.20" note="', b"a" * (1 << 20), b'"></net>', 2 << 30),
    "elements": (b'<net version="1.20">', b"<x/>" * (1 << 18), b"</net>", 2 << 30),
    "comment": (b'<net version="1.20"><!--', b"a" * (1 << 20), b"--></net>", 2 << 30),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BOMBS)
def test_convert_refuses_a_gzip_bomb(name: str, bench: Bench) -> None:
    path = bench.folder / "input" / "bomb.net.xml.gz"
    with path.open("wb") as stream:
        stream.writelines(_bomb(*BOMBS[name]))
    assert path.stat().st_size < 20 << 20
    check_bomb_is_refused(bench, path)


def _with_doctype(good: bytes, declarations: str, reference: str) -> bytes:
    text = good.decode().replace("<net ", f"<!DOCTYPE net [{declarations}]><net ", 1)
    return text.replace('<edge id="e" ', f'<edge id="e" name="{reference}" ', 1).encode()


def _laughs() -> str:
    lines = ['<!ENTITY a0 "ha">']
    lines += [f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 12)]
    return "".join(lines)


ENTITIES: dict[str, tuple[str, str]] = {
    "billion_laughs": (_laughs(), "&a11;"),
    "quadratic": (f'<!ENTITY a "{"x" * 100_000}">', "&a;" * 20_000),
    "unused_entity": ('<!ENTITY a "harmless">', "plain"),
    "parameter_entity": ("<!ENTITY % p '<!ENTITY q \"boo\">'> %p;", "&q;"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ENTITIES)
def test_convert_refuses_entities(name: str, good: bytes, bench: Bench) -> None:
    declarations, reference = ENTITIES[name]
    path = bench.write("input.net.xml", _with_doctype(good, declarations, reference))
    check_bomb_is_refused(bench, path)


def test_convert_never_reads_an_external_entity(good: bytes, bench: Bench) -> None:
    secret = bench.write("secret.txt", b"the-secret-of-the-house")
    text = good.decode().replace("<net ", f'<!DOCTYPE net [<!ENTITY s SYSTEM "{secret.as_uri()}">]><net ', 1)
    text = text.replace("</net>", "<param>&s;</param></net>")
    done = bench.convert(bench.write("input.net.xml", text.encode()), "-o", bench.output)
    check_refused(done, 3)
    assert "the-secret-of-the-house" not in done.stderr
    assert bench.left_behind() == set()


@pytest.mark.parametrize("target", ["http://127.0.0.1:9/net.dtd", "nowhere.dtd", "file:///dev/zero"])
def test_convert_never_reads_an_external_dtd(target: str, good: bytes, bench: Bench) -> None:
    text = good.decode().replace("<net ", f'<!DOCTYPE net SYSTEM "{target}"><net ', 1)
    check_refused_input(bench, bench.write("input.net.xml", text.encode()))


@pytest.mark.parametrize("name", DAMAGES)
def test_convert_refuses_or_reports_a_damaged_network(name: str, good: bytes, bench: Bench) -> None:
    done = bench.convert(bench.write("input.net.xml", DAMAGES[name](good)), "-o", bench.output)
    # Status 0 would mean that a value was made up in silence.
    assert done.returncode in {1, 3}, (done.returncode, done.stderr[-500:])
    check_fair_end(bench, done)


def check_fair_end(bench: Bench, done: subprocess.CompletedProcess[str]) -> None:
    """Either a refusal in one line with nothing left, or a whole bundle that can be read."""
    if done.returncode in {3, 4}:
        check_refused(done, 3, 4)
        assert bench.left_behind() == set()
        return
    assert done.returncode in {0, 1}, (done.returncode, done.stderr[-1000:])
    assert "Traceback" not in done.stderr
    assert bench.left_behind() == {"out.dojo"}
    check_whole(bench.output)


def check_whole(bundle: Path) -> None:
    assert {path.name for path in bundle.iterdir()} >= BUNDLE
    assert read_strict_json(bundle / "map.json")["format"] == "dojo-map"
    assert read_strict_json(bundle / "report.json")["format"] == "dojo-report"
    assert read_gltf_json(bundle / "scene.glb")["meshes"]
    assert (bundle / "overview.png").read_bytes()[-8:-4] == b"IEND"
    assert (bundle / "report.html").read_text(encoding="utf-8").rstrip().endswith("</html>")


@pytest.mark.parametrize("name", ODDITIES)
def test_convert_ends_fairly_on_an_odd_network(name: str, good: bytes, bench: Bench) -> None:
    done = bench.convert(bench.write("input.net.xml", ODDITIES[name](good)), "-o", bench.output)
    check_fair_end(bench, done)


def test_report_page_escapes_ids_made_of_markup(good: bytes, bench: Bench) -> None:
    path = bench.write("input.net.xml", ODDITIES["id_of_markup"](good))
    if bench.convert(path, "-o", bench.output).returncode in {0, 1}:
        assert "<img src=x" not in (bench.output / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("argument", ["missing.net.xml", "missing/deep/x.net.xml.gz", "cologne99", "", "\n"])
def test_convert_refuses_a_missing_input(argument: str, bench: Bench) -> None:
    check_refused_input(bench, argument)


def test_convert_refuses_a_folder_as_input(bench: Bench) -> None:
    folder = bench.folder / "input" / "folder.net.xml"
    folder.mkdir()
    check_refused_input(bench, folder)


def test_convert_refuses_an_unreadable_input(good: bytes, bench: Bench) -> None:
    path = bench.write("locked.net.xml", good)
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read everything")
    check_refused_input(bench, path)


def test_convert_reads_a_read_only_input(good: bytes, bench: Bench) -> None:
    path = bench.write("locked.net.xml", good)
    path.chmod(0o444)
    assert bench.convert(path, "-o", bench.output).returncode in {0, 1}
    assert path.read_bytes() == good


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("--no-generatedd",),
        ("--export", "fbx"),
        ("--jobs", "many"),
        ("--jobs", "-3"),
        ("-o",),
        ("another.net.xml",),
    ],
)
def test_convert_refuses_wrong_usage(arguments: tuple[str, ...], good: bytes, bench: Bench) -> None:
    path = bench.write("input.net.xml", good)
    done = bench.convert(*([path] if arguments else []), *arguments)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert done.stderr
    assert bench.left_behind() == set()


@pytest.mark.parametrize("arguments", [(), ("conwert",), ("--nonsense",)])
def test_command_line_refuses_wrong_usage(arguments: tuple[str, ...]) -> None:
    done = dojo_maps(*arguments)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert done.stderr


@pytest.mark.parametrize("arguments", [("--help",), ("convert", "--help")])
def test_command_line_explains_itself(arguments: tuple[str, ...]) -> None:
    done = dojo_maps(*arguments)
    assert done.returncode == 0
    assert "convert" in done.stdout
    assert done.stderr == ""


def test_convert_refuses_a_file_as_output(good: bytes, bench: Bench) -> None:
    path = bench.write("input.net.xml", good)
    bench.output.write_bytes(b"precious")
    check_refused(bench.convert(path, "-o", bench.output), 2)
    assert bench.output.read_bytes() == b"precious"
    assert bench.left_behind() == {"out.dojo"}


def test_convert_refuses_a_folder_with_other_files_as_output(good: bytes, bench: Bench) -> None:
    path = bench.write("input.net.xml", good)
    (bench.output / "photos").mkdir(parents=True)
    (bench.output / "photos" / "holiday.jpg").write_bytes(b"precious")
    before = snapshot(bench.folder / "work")
    check_refused(bench.convert(path, "-o", bench.output), 2)
    assert snapshot(bench.folder / "work") == before


def test_convert_refuses_the_folder_it_is_run_in(good: bytes, bench: Bench) -> None:
    path = bench.write("input.net.xml", good)
    (bench.folder / "work" / "notes.txt").write_bytes(b"precious")
    done = bench.convert(path, "-o", ".")
    check_refused(done, 2)
    assert bench.left_behind() == {"notes.txt"}


def test_convert_refuses_its_own_input_as_output(good: bytes, bench: Bench) -> None:
    path = bench.write("input.net.xml", good)
    check_refused(bench.convert(path, "-o", path), 2)
    assert path.read_bytes() == good


def test_convert_fills_an_empty_folder(good: bytes, bench: Bench) -> None:
    bench.output.mkdir()
    assert bench.convert(bench.write("a.net.xml", good), "-o", bench.output).returncode in {0, 1}
    check_whole(bench.output)
    assert bench.left_behind() == {"out.dojo"}


def test_convert_takes_an_output_with_a_slash_behind(good: bytes, bench: Bench) -> None:
    done = bench.convert(bench.write("a.net.xml", good), "-o", f"{bench.output}{os.sep}")
    assert done.returncode in {0, 1}
    assert bench.left_behind() == {"out.dojo"}


def test_convert_refuses_a_missing_parent_as_output(good: bytes, bench: Bench) -> None:
    path = bench.write("input.net.xml", good)
    check_refused(bench.convert(path, "-o", bench.output / "deeper" / "map.dojo"), 2)
    assert bench.left_behind() == set()


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder that nobody may write to")
def test_convert_refuses_an_unwritable_parent_as_output(good: bytes, bench: Bench) -> None:
    path = bench.write("input.net.xml", good)
    check_refused(bench.convert(path, "-o", "/proc/self/map.dojo"), 2, 4)
    assert bench.left_behind() == set()


def test_convert_follows_no_link_as_output(good: bytes, bench: Bench) -> None:
    elsewhere = bench.folder / "input" / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "file.txt").write_bytes(b"precious")
    bench.output.symlink_to(elsewhere)
    done = bench.convert(bench.write("input.net.xml", good), "-o", bench.output)
    check_refused(done, 2)
    assert snapshot(elsewhere) == {"file.txt": b"precious"}


def test_convert_follows_no_link_that_leads_nowhere(good: bytes, bench: Bench) -> None:
    bench.output.symlink_to("nowhere")
    check_refused(bench.convert(bench.write("input.net.xml", good), "-o", bench.output), 2)
    assert bench.output.is_symlink()


BROKEN = {**DAMAGES, "empty": lambda _: b"", "truncated": lambda good: good[:-3000]}


@pytest.mark.parametrize("name", ["empty", "truncated", "shape_words", "shape_missing", "missing"])
def test_failed_conversion_leaves_an_existing_bundle_untouched(
    name: str, good: bytes, bench: Bench, converted: Callable[..., Conversion]
) -> None:
    shutil.copytree(converted("village").folder, bench.output)
    before = snapshot(bench.output)
    path = bench.folder / "input" / "x.net.xml"
    if name != "missing":
        bench.write(path.name, BROKEN[name](good))
    check_refused(bench.convert(path, "-o", bench.output), 3)
    assert snapshot(bench.output) == before
    assert bench.left_behind() == {"out.dojo"}


def _interrupt(bench: Bench, network: Path, number: int, wait: float) -> tuple[int, str]:
    """Start a conversion, send it a signal after a while, and tell how it ended."""
    with subprocess.Popen(
        [sys.executable, "-m", "dojo_maps.cli", "convert", network, "-o", bench.output],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        cwd=bench.folder / "work",
        env=command_environment(TMPDIR=str(bench.temporary)),
    ) as process:
        time.sleep(wait)
        process.send_signal(number)
        _, errors = process.communicate(timeout=TIME_LIMIT)
    return process.returncode, errors


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("wait", [0.5, 1.2, 2.4])
def test_interrupted_conversion_leaves_the_old_bundle_whole(
    number: int,
    wait: float,
    bench: Bench,
    converted: Callable[..., Conversion],
    network_path: Callable[[str], Path],
) -> None:
    shutil.copytree(converted("village").folder, bench.output)
    before = snapshot(bench.output)
    status, errors = _interrupt(bench, network_path("ingolstadt21"), number, wait)
    assert bench.left_behind() == {"out.dojo"}
    check_whole(bench.output)
    if status in {0, 1}:
        return  # it was done before the signal came
    after = snapshot(bench.output)
    # A signal after the swap finds the new bundle in place, and that one is whole too.
    assert after == before or after["network.net.xml"] == network_path("ingolstadt21").read_bytes()
    assert status in {-number, 128 + number, 130, 4}
    # While Python itself is still starting, it is Python that answers an interruption.
    assert wait < 1.0 or "Traceback" not in errors


def test_interrupted_conversion_leaves_nothing_where_nothing_was(
    bench: Bench, network_path: Callable[[str], Path]
) -> None:
    status, _ = _interrupt(bench, network_path("ingolstadt21"), signal.SIGTERM, 1.0)
    assert bench.left_behind() == ({"out.dojo"} if status in {0, 1} else set())


@contextlib.contextmanager
def _started(bench: Bench, *arguments: object) -> Iterator[subprocess.Popen[str]]:
    """Run the command so that it names each module on standard error as soon as that one is loaded."""
    # What a shell or a CI job lets its background processes ignore, the command would ignore, too.
    former = {number: signal.signal(number, signal.default_int_handler) for number in INTERRUPTIONS}
    try:
        process = subprocess.Popen(
            [sys.executable, "-X", "importtime", "-m", "dojo_maps", *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=bench.folder / "work",
            env=command_environment(TMPDIR=str(bench.temporary)),
        )
    finally:
        for number, answer in former.items():
            signal.signal(number, answer)
    with process:
        yield process


def _wait_until_loaded(process: subprocess.Popen[str], count: int) -> None:
    """Wait for the first of numpy's modules, which only a command loads, and for more after that one."""
    assert process.stderr is not None
    lines = iter(process.stderr.readline, "")
    assert any(line.rpartition("|")[2].strip().startswith("numpy") for line in lines)
    list(islice(lines, count))


def _check_interrupted(process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    assert process.stderr is not None
    # The rest of a line that was read in part is still in this stream.
    said = [line.strip() for line in process.stderr if not line.startswith("import time:")]
    output = process.stdout.read()
    assert process.wait(TIME_LIMIT) == 130, said
    assert len(said) == 1, said
    assert said[0].startswith("dojo-maps: interrupted; ")
    assert output == ""


@pytest.mark.parametrize("number", INTERRUPTIONS)
@pytest.mark.parametrize("count", random.Random(7).sample(range(600), 8))  # noqa: S311 - no secret
def test_interruption_while_modules_load_ends_the_command_in_one_line(
    number: int, count: int, bench: Bench, network_path: Callable[[str], Path]
) -> None:
    with _started(bench, "convert", network_path("ingolstadt21"), "-o", bench.output) as process:
        _wait_until_loaded(process, count)
        process.send_signal(number)
        _check_interrupted(process)
    assert bench.left_behind() == set()


@pytest.mark.parametrize("number", INTERRUPTIONS)
@pytest.mark.parametrize("wait", [0.05, 0.21, 0.38, 0.56, 0.83, 1.2])
def test_interruption_at_any_time_ends_the_command_in_one_line(
    number: int, wait: float, bench: Bench, network_path: Callable[[str], Path]
) -> None:
    with _started(bench, "convert", network_path("ingolstadt21"), "-o", bench.output) as process:
        _wait_until_loaded(process, 0)
        time.sleep(wait)
        # Both at once, as from a service that is being stopped, are one interruption.
        process.send_signal(number)
        process.send_signal(signal.SIGINT)
        _check_interrupted(process)
    assert bench.left_behind() == set()


def test_main_leaves_signals_to_the_program_that_calls_it(capsys: pytest.CaptureFixture[str]) -> None:
    before = [signal.getsignal(number) for number in INTERRUPTIONS]
    assert main(["checks"]) == 0
    assert [signal.getsignal(number) for number in INTERRUPTIONS] == before
    with ThreadPoolExecutor(max_workers=1) as pool:
        assert pool.submit(main, ["checks"]).result() == 0


def test_convert_writes_no_progress_into_pipes(good: bytes, bench: Bench) -> None:
    done = bench.convert(bench.write("a.net.xml", good), "-o", bench.output)
    assert "\r" not in done.stderr
    assert "\x1b" not in done.stderr + done.stdout


def test_convert_says_nothing_on_standard_error_when_quiet(good: bytes, bench: Bench) -> None:
    done = bench.convert(bench.write("a.net.xml", good), "-o", bench.output, "--quiet")
    assert done.returncode in {0, 1}
    assert done.stderr == ""


def test_convert_ends_fairly_on_a_network_damaged_at_random(
    fuzz_seed: int, bench: Bench, network_path: Callable[[str], Path]
) -> None:
    chance = random.Random(fuzz_seed)  # noqa: S311 - the same damage on every run
    damaged = damage(network_path("cologne1").read_bytes(), chance)
    done = bench.convert(bench.write("damaged.net.xml", damaged), "-o", bench.output)
    check_fair_end(bench, done)


@pytest.mark.parametrize("name", ENDLESS)
def test_convert_refuses_shapes_that_would_take_hours(name: str, bench: Bench) -> None:
    check_refused_input(bench, bench.write("endless.net.xml", ENDLESS[name]()))


UNDRAWABLE: dict[str, Callable[[bytes], bytes]] = {
    **{
        f"width_{width}": lambda good, width=width: replaced(
            good, '<lane id="e_0"', f'<lane id="e_0" width="{width}"'
        )
        for width in ("1e4", "1e9", "1e12")
    },
    "height": lambda _: network_of("0,0,0 100,0,90000000"),
    "around_the_world": lambda _: network_of(*[f"0,{4 * k} 900000,{4 * k}" for k in range(30)]),
}


@pytest.mark.parametrize("name", UNDRAWABLE)
def test_a_value_that_nobody_can_draw_is_an_issue_and_costs_itself(
    name: str, good: bytes, bench: Bench
) -> None:
    done = bench.convert(bench.write("odd.net.xml", UNDRAWABLE[name](good)), "-o", bench.output)
    check_fair_end(bench, done)
    assert done.returncode == 1
    check_whole(bench.output)
    issues = read_strict_json(bench.output / "report.json")["issues"]
    assert any(issue["check"] == "geometry.unusable_value" for issue in issues)


@pytest.mark.parametrize("name", LARGE)
def test_convert_takes_shapes_almost_as_large_as_it_can(name: str, bench: Bench) -> None:
    check_fair_end(bench, bench.convert(bench.write("large.net.xml", LARGE[name]()), "-o", bench.output))
    check_whole(bench.output)
