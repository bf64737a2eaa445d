"""What repairs cost traffic: the same generated demand waits before and after them, in SUMO."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from dojo_maps.demand import write_demand
from dojo_maps.errors import DojoError
from dojo_maps.input_files import read_bytes
from dojo_maps.repair.edits import Rebuild, SetPhases, SetRequests
from dojo_maps.repair.rounds import Fixed, State
from dojo_maps.safe_xml import Attributes, parse_xml
from dojo_maps.sumo_loading import Loading, start_sumo
from dojo_maps.validation.sumo_checks import check_refused
from dojo_maps.whole_file import scratch_folder

SECONDS = 900
"""Simulated: some ten cycles of every signal."""
_DEMAND, _STATISTICS = "demand.rou.xml", "statistics.xml"
_OPTIONS = (
    *("--route-files", _DEMAND, "--end", str(SECONDS), "--ignore-route-errors", "--no-warnings"),
    *("--statistic-output", _STATISTICS, "--duration-log.statistics", "--tripinfo-output.write-unfinished"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Waiting:
    """How long vehicles wait: standing on the road, and before they find room to enter it.

    Attributes:
        seconds: the mean of all vehicles.
        vehicles: how many there were.
    """

    seconds: float
    vehicles: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What repairs cost the same traffic; where it could not be measured, `reason` says why.

    Attributes:
        before: on the network as it was.
        after: on the mended network.
        reason: why one of them is missing.
    """

    before: Waiting | None
    after: Waiting | None
    reason: str = ""

    def __str__(self) -> str:
        """Say it in a line."""
        measured = [each for each in (self.before, self.after) if each]
        if not measured:
            return f"mean waiting: not measured ({self.reason})"
        times = [f"{each.seconds:.1f} s" if each else "not measured" for each in (self.before, self.after)]
        counts = " and ".join(str(count) for count in dict.fromkeys(each.vehicles for each in measured))
        what = f"{counts} vehicles in {SECONDS // 60} minutes of generated demand"
        details = "; ".join(filter(None, (what, self.reason)))
        return f"mean waiting: {times[0]} before, {times[1]} after ({details})"


def measure_cost(fixed: Fixed) -> Cost | None:
    """Simulate generated demand on the network before and after its repair, for a bounded time.

    The demand is that of the network before, or, where SUMO refuses to load that, of the mended one; where
    roads were joined, each network has its own.

    Args:
        fixed: a repair, with the network before and after it.

    Returns:
        The waiting, or why it is not known; None where neither signals nor right of way were changed.
    """
    if not _changes_who_goes(fixed):
        return None
    states = (fixed.before, fixed.after)
    joined = set(fixed.before.site.facts.roads) != set(fixed.after.site.facts.roads)
    source = states[check_refused.id in fixed.before.counts]
    try:
        with ExitStack() as stack:
            folder = stack.enter_context(scratch_folder())
            runs = [
                _start(state, state if joined else source, folder / name, stack)
                for name, state in zip(("before", "after"), states, strict=True)
            ]
            found = [_waiting(*run) for run in runs]
    except (DojoError, OSError) as error:
        return Cost(before=None, after=None, reason=str(error))
    waits = [each if isinstance(each, Waiting) else None for each in found]
    reasons = dict.fromkeys(each for each in found if isinstance(each, str))
    return Cost(before=waits[0], after=waits[1], reason="; ".join(reasons))


def _changes_who_goes(fixed: Fixed) -> bool:
    changes = [change for made in fixed.made for change in made.edit.changes]
    return any(
        isinstance(change, SetPhases | SetRequests | Rebuild) or change.key[0] == "connection"
        for change in changes
    )


def _start(state: State, source: State, folder: Path, stack: ExitStack) -> tuple[Loading | None, Path]:
    """Let SUMO simulate the demand of one network on another; None where that cannot be."""
    folder.mkdir()
    network = folder / "source.net.xml"
    network.write_bytes(source.data)
    if write_demand(source.site.facts.map, network, folder / _DEMAND) is None:
        raise DojoError("no vehicle crosses a junction")
    return start_sumo(state.data, folder, _OPTIONS, stack), folder


def _waiting(run: Loading | None, folder: Path) -> Waiting | str:
    """Read what SUMO measured, or say why it did not."""
    if run is None:
        return "the network holds more than a network"
    verdict = run.verdict
    if not verdict.accepted:
        return next((f"SUMO: {words}" for words in verdict.errors), "SUMO has not come to an end in time")
    read = _read_statistics(folder / _STATISTICS)
    trips, vehicles = read.get("vehicleTripStatistics", {}), read.get("vehicles", {})
    entered, outside = int(trips.get("count", 0)), int(vehicles.get("waiting", 0))
    if not entered + outside:
        return "no vehicle can drive"
    seconds = entered * float(trips["waitingTime"]) + float(trips["totalDepartDelay"])
    return Waiting(seconds=seconds / (entered + outside), vehicles=entered + outside)


def _read_statistics(path: Path) -> dict[str, Attributes]:
    read: dict[str, Attributes] = {}

    def start(name: str, attributes: Attributes) -> None:
        read[name] = attributes

    parse_xml(read_bytes(path), path, root="statistics", kind="SUMO statistics", start=start)
    return read
