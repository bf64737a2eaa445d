"""Demand on disk: in a bundle, or a route file with a configuration to start; whole or not at all."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote
from xml.sax.saxutils import quoteattr

from dojo_maps import bundle
from dojo_maps.demand import Demand, DemandOptions, as_json, write_demand
from dojo_maps.demand.counts import read_counts
from dojo_maps.description import RoadMap
from dojo_maps.errors import DescriptionError, DojoError, UsageError
from dojo_maps.input_files import is_there
from dojo_maps.inspection import inspect, read_source, write_reports
from dojo_maps.report.page import write_page
from dojo_maps.safe_json import read_json
from dojo_maps.sources.files import map_name
from dojo_maps.whole_file import added_files

_ENDING = ".rou.xml"


def deliver_demand(
    source: str,
    options: DemandOptions,
    *,
    counts: Path | None = None,
    output: Path | None = None,
    json: Path | None = None,
    html: Path | None = None,
) -> tuple[Demand, Path]:
    """Write demand for a bundle or a network.

    A bundle's own demand and report are replaced, unless an output is named. Beside a network's routes lies a
    configuration that names both.

    Args:
        source: a bundle, or a SUMO network by path or name.
        options: what traffic; begin and end are those of the counts, where these name any.
        counts: a CSV file of counts to meet.
        output: the route file; by default the bundle's own, or NAME.demand.rou.xml in the current folder.
        json: a report on map and demand to write.
        html: the same as a page.

    Returns:
        What was written, and what to start it by: the bundle, the configuration, or the routes of a bundle.

    Raises:
        SourceError: the map or the counts cannot be read, or do not fit each other.
        UsageError: the output cannot be named so.
        DojoError: nobody can drive on the map, or the counts cannot be met.
    """
    if output is not None and not output.name.endswith(_ENDING):
        raise UsageError(f"-o {output}: a route file's name ends in {_ENDING}; rename it")
    folder = Path(source)
    if is_there(folder / bundle.DESCRIPTION):
        opened = bundle.open_bundle(folder)
        road_map, network = opened.road_map, opened.network
    else:
        read = read_source(source)
        road_map, network = read.road_map, read.path
        output = output or Path(f"{map_name(Path(source))}.demand{_ENDING}")
    if counts is not None:
        options = _with_counts(options, counts, road_map)
    place = folder if output is None else output.parent
    if not place.is_dir():
        raise UsageError(f"{place}: no such folder; make it first, or choose another with -o")
    with added_files(place) as fresh:
        routes = fresh / (bundle.DEMAND if output is None else output.name)
        demand = write_demand(road_map, network, routes, options)
        if demand is None:
            raise DojoError(f"{source}: no car or bus can cross a junction; there is no demand to write")
        start = folder
        if output is None:
            _renew_report(folder, fresh, road_map, as_json(demand))
        elif network.parent == folder:
            start = output
        else:
            start = output.with_name(f"{output.name.removesuffix(_ENDING)}.sumocfg")
            text = _configuration(network, output, demand)
            (fresh / start.name).write_text(text, encoding="utf-8")
    if json or html:
        inspected, report = inspect(source)
        write_reports(inspected, report | {"demand": as_json(demand)}, json=json, html=html)
    return demand, start


def _with_counts(options: DemandOptions, path: Path, road_map: RoadMap) -> DemandOptions:
    counts = read_counts(path, road_map, begin=options.begin, end=options.end)
    begin, end = min(count.begin for count in counts), max(count.end for count in counts)
    return replace(options, counts=counts, begin=begin, end=end)


def _renew_report(folder: Path, fresh: Path, road_map: RoadMap, demand: Mapping[str, Any]) -> None:
    """Write a bundle's report anew, with its demand."""
    path = folder / bundle.REPORT
    report = read_json(path, error=DescriptionError)
    try:
        report = {**report, "demand": demand}
        write_page(report, road_map, fresh / bundle.REPORT_PAGE)
    except (LookupError, TypeError, ValueError, AttributeError) as problem:
        raise DescriptionError(path, "not a report of a map; convert the map again") from problem
    bundle.write_json(fresh / bundle.REPORT, report)


def _configuration(network: Path, routes: Path, demand: Demand) -> str:
    """Write a SUMO configuration, which names files from its own folder, with % as in addresses."""
    relative = os.path.relpath(network.absolute(), routes.absolute().parent)
    return f"""<configuration>
    <input>
        <net-file value={quoteattr(quote(relative))}/>
        <route-files value={quoteattr(quote(routes.name))}/>
    </input>
    <time>
        <begin value="{demand.begin:g}"/>
        <end value="{demand.end:g}"/>
    </time>
    <processing>
        <ignore-junction-blocker value="{bundle.JUNCTION_BLOCKER}"/>
    </processing>
</configuration>
"""
