"""Let netconvert build a network anew where no smaller change will do, and keep its signal programs."""

from collections.abc import Sequence
from pathlib import Path

from dojo_maps.repair.edits import Rebuild
from dojo_maps.signals.programs import read_seconds
from dojo_maps.sources.enrich_net import enrich_network
from dojo_maps.sources.netconvert import NetconvertError, build_again
from dojo_maps.sources.sumo_xml import LogicRecord, read_records


def rebuild(data: bytes, rebuilds: Sequence[Rebuild], path: Path) -> bytes:
    """Build a network anew, with what is to be added; signal programs stay.

    Args:
        data: the network's bytes, unpacked.
        rebuilds: what is to be added to its plain files; nodes count only where no connections are added.
        path: where the network came from, for errors.

    Returns:
        The new network's bytes.

    Raises:
        NetconvertError: netconvert refuses the network, crashes on it, or changes a program.
        TransplantError: netconvert changed something for vehicles that cannot be put back.
        SourceError: one of the network's signals is broken.
        ToolMissingError: netconvert is not installed.
    """
    added = "".join(f"    {element}\n" for each in rebuilds for element in each.connections)
    if added:
        return enrich_network(data, path=path, options=("--walkingareas",), connections=added)[0]
    nodes = "".join(f"    {element}\n" for each in rebuilds for element in each.nodes)
    built, _ = build_again(data, nodes=nodes)
    before, after = (_programs(read_records(each, path).logics) for each in (data, built))
    if before != after:
        raise NetconvertError("netconvert would change signal programs")
    return built


def _programs(logics: Sequence[LogicRecord]) -> dict[tuple[str, str], list[tuple[str, float]]]:
    """What every program shows, and for how long."""
    return {
        (logic.attributes.get("id", ""), logic.attributes.get("programID", "")): [
            (phase.get("state", ""), read_seconds(phase.get("duration", "0"))) for phase in logic.phases
        ]
        for logic in logics
    }
