"""Checks of signals as a whole: what they control, where they stand, whether a controller can drive them."""

from collections.abc import Iterator

import numpy as np
import shapely

from dojo_maps.description import Program
from dojo_maps.signals.programs import GREEN, YELLOW, following
from dojo_maps.validation.check import WARNING, Check, Finding, Need, check, element
from dojo_maps.validation.facts import Facts
from dojo_maps.validation.profiles import Limits
from dojo_maps.validation.programs import signals_of
from dojo_maps.wording import counted


@check(
    id="signals.crossing_uncontrolled_at_tls",
    code="SIG011",
    title="Crossings at signals have a light",
    severity=WARNING,
    limit="every crossing of a signalised junction",
    source="SUMO Simulation/Pedestrians",
    hint="control the crossing in netedit, or set tl and linkIndex of the way onto it",
)
def check_crossing_uncontrolled(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find crossings at signalised junctions that no signal controls.

    Args:
        facts: of the map; generated crossings do not count.
        _limits: there is none to this check.

    Yields:
        A finding for each such crossing, at its start.
    """
    for crossing in facts.crossings.values():
        kind = facts.kind(crossing.junction)
        if crossing.signal is None and kind.startswith("traffic_light"):
            yield Finding(
                elements=(*element("crossing", crossing.id), *element("junction", crossing.junction)),
                at=crossing.shape[0],
                message=f"the crossing {crossing.id} at the signal of {crossing.junction} has no light",
            )


@check(
    id="signals.tls_trivial",
    code="SIG012",
    title="Signals have something to control",
    severity=WARNING,
    limit="3 links and 2 phases",
    source="netconvert --tls.discard-simple",
    hint="remove the signal, or join it with the one it belongs to",
)
def check_tls_trivial(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find signals that control hardly anything, or that never change.

    Args:
        facts: of the map.
        _limits: there is none to this check; 3 links and 2 phases are its own.

    Yields:
        A finding for each such signal, with its number of links or, where it is lower, that of the phases of
        its longest program.
    """
    for signal in signals_of(facts):
        links = len(signal.signal.links)
        phases = max((len(program.phases) for program in signal.signal.programs), default=0)
        if links <= 2 or phases < 2:
            yield Finding(
                elements=element("signal", signal.signal.id),
                at=signal.middle,
                message=f"the signal {signal.signal.id} has {counted(links, 'link')} and "
                f"{counted(phases, 'phase')}",
                measured=float(min(links, phases)),
                limit=3.0 if links <= 2 else 2.0,
            )


@check(
    id="signals.split_signals",
    code="SIG013",
    title="One intersection has one signal",
    severity=WARNING,
    limit="25 m",
    source="netconvert --tls.guess-signals.dist (25 m), --tls.join-dist (20 m)",
    hint="join the signals: netconvert --tls.join, or one tl id for both nodes",
)
def check_split_signals(facts: Facts, limits: Limits) -> Iterator[Finding]:
    """Find signals so close to each other that they stand at one intersection.

    Args:
        facts: of the map.
        limits: `split_signals`, metres between junctions of two signals.

    Yields:
        A finding for each pair of signals, with the distance of the first two of their junctions that are too
        near, metres.
    """
    at: list[tuple[str, np.ndarray]] = []
    for signal in facts.signals:
        known = [facts.junctions[j].position for j in signal.junctions if j in facts.junctions]
        at += [(signal.id, np.array(position)) for position in known]
    places = shapely.points(np.array([position[:2] for _, position in at]).reshape(-1, 2))
    pairs = shapely.STRtree(places).query(places, predicate="dwithin", distance=limits.split_signals)
    seen: set[frozenset[str]] = set()
    for k, n in sorted((k, n) for k, n in pairs.T.tolist() if k < n):
        (one, here), (other, there) = at[k], at[n]
        apart = float(np.hypot(*(here - there)[:2]))
        pair = frozenset((one, other))
        if one != other and apart < limits.split_signals and pair not in seen:
            seen.add(pair)
            yield Finding(
                elements=element("signal", one, other),
                at=here,
                message=f"the signals {one} and {other} stand {apart:.1f} m apart",
                measured=apart,
                limit=limits.split_signals,
            )


@check(
    id="signals.rl_form",
    code="SIG016",
    title="A controller can drive the program",
    severity=WARNING,
    limit="two green phases, each followed by yellow or red",
    source="LucasAlegre/sumo-rl 46, 117",
    hint="give each green its own phase, followed by one with yellow",
)
def check_rl_form(facts: Facts, _limits: Limits) -> Iterator[Finding]:
    """Find programs that a controller cannot drive green by green: too few, or not parted by a clearance.

    Of several programs SUMO runs the last one.

    Args:
        facts: of the map; signals with at most two links do not count.
        _limits: there is none to this check.

    Yields:
        A finding for each such signal, with the first problem of its last program.
    """
    for signal in signals_of(facts):
        for program in signal.programs[-1:]:
            problem = _undrivable(program)
            if problem and len(signal.signal.links) > 2:
                yield Finding(
                    elements=element("signal", signal.signal.id),
                    at=signal.middle,
                    message=f"{signal.named(program)} {problem}",
                )


def _undrivable(program: Program) -> str:
    states = [phase.state for phase in program.phases]
    greens = [k for k, state in enumerate(states) if GREEN & set(state) and not YELLOW & set(state)]
    if len(greens) < 2:
        return (
            f"has {counted(len(greens), 'green phase')} without yellow, a controller needs two to choose from"
        )
    for phase in greens:
        for after in following(program, phase):
            gained = any(
                new in GREEN and old not in GREEN
                for old, new in zip(states[phase], states[after], strict=False)
            )
            lost = any(
                new in "rs" and old in GREEN for old, new in zip(states[phase], states[after], strict=False)
            )
            if after in greens and gained and lost:
                return f"goes from the green phase {phase} to the green phase {after} without a clearance"
    return ""


MISSING_SIGNAL = Check(
    id="osm.missing_signal",
    code="SIG014",
    title="Signals of OpenStreetMap are in the network",
    severity=WARNING,
    limit="30 m from a cluster of signals within 45 m",
    source="netconvert --tls.guess-signals",
    hint="set the junction's type to traffic_light",
    needs=Need.IMPORT,
)
