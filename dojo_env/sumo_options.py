"""SUMO's options, sorted by what a configuration file may ask for: it comes from anywhere, so it is data.

`SIMULATION` is taken as it stands. `OUTPUTS` write, or say how, and need a folder of the user's. `NEVER`
opens ports, runs scripts, loads or saves states, prints, shows, or makes two runs differ. The lists are those
of SUMO 1.28, by its own topics; an option that is in none of them is left out like those of `NEVER`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from dojo_env.elements import read_elements
from dojo_env.errors import ScenarioError
from dojo_maps.input_files import is_there

ROOTS = ("configuration", "sumoConfiguration")
"""What a configuration's root element is called. SUMO does not look at it."""
FILES = ("net-file", "route-files", "additional-files")
"""What a scenario is made of."""
READ = {
    *("weight-files", "phemlight-path"),
    *("fcd-output.filter-edges.input-file", "device.ssm.filter-edges.input-file"),
}
"""Other options that name what is read."""

_INPUT = "weight-files weight-attribute junction-taz"
_TIME = "begin end step-length"
_PROCESSING = """
step-method.ballistic extrapolate-departpos lateral-resolution route-steps no-internal-links
ignore-junction-blocker ignore-route-errors ignore-accidents collision.action intermodal-collision.action
collision.stoptime intermodal-collision.stoptime collision.check-junctions collision.check-junctions.mingap
collision.mingap-factor keep-after-arrival max-num-vehicles max-num-persons max-num-teleports scale
scale-suffix time-to-teleport time-to-teleport.highways time-to-teleport.highways.min-speed
time-to-teleport.disconnected time-to-teleport.remove time-to-teleport.remove-constraint time-to-teleport.ride
time-to-teleport.bidi time-to-teleport.railsignal-deadlock waiting-time-memory startup-wait-threshold
max-depart-delay sloppy-insert eager-insert emergency-insert insertion-checks random-depart-offset
lanechange.duration lanechange.overtake-right tls.all-off tls.actuated.show-detectors
tls.actuated.jam-threshold tls.actuated.detector-length tls.delay_based.detector-range tls.yellow.min-decel
railsignal-moving-block railsignal.moving-block.default-classes railsignal.moving-block.max-dist
railsignal.max-block-length railsignal.default-classes slope-centered time-to-impatience default.departspeed
default.departlane default.action-step-length default.carfollowmodel default.speeddev default.emergencydecel
overhead-wire.solver overhead-wire.recuperation overhead-wire.substation-current-limits
emergencydecel.warning-threshold parking.maneuver use-stop-ended use-stop-started pedestrian.model
pedestrian.timegap-crossing pedestrian.striping.stripe-width pedestrian.striping.dawdling
pedestrian.striping.mingap-to-vehicle pedestrian.striping.jamtime pedestrian.striping.jamtime.crossing
pedestrian.striping.jamtime.narrow pedestrian.striping.jamfactor pedestrian.striping.reserve-oncoming
pedestrian.striping.reserve-oncoming.junctions pedestrian.striping.reserve-oncoming.max
pedestrian.striping.legacy-departposlat pedestrian.striping.walkingarea-detail
pedestrian.jupedsim.step-length pedestrian.jupedsim.exit-tolerance pedestrian.jupedsim.model
pedestrian.jupedsim.strength-neighbor-repulsion pedestrian.jupedsim.range-neighbor-repulsion
pedestrian.jupedsim.strength-geometry-repulsion pedestrian.jupedsim.range-geometry-repulsion
ride.stop-tolerance mapmatch.distance mapmatch.junctions mapmatch.taz weights.turnaround-penalty
weights.reversal-penalty persontrip.walk-opposite-factor
"""
_ROUTING = """
routing-algorithm weights.random-factor weights.random-factor.dynamic weights.minor-penalty
weights.tls-penalty weights.priority-factor weights.separate-turns persontrip.walkfactor
persontrip.transfer.car-walk persontrip.transfer.taxi-walk persontrip.transfer.walk-taxi
persontrip.default.group persontrip.taxi.waiting-time persontrip.ride-public-line railway.max-train-length
replay-rerouting device.rerouting.probability device.rerouting.explicit device.rerouting.deterministic
device.rerouting.period device.rerouting.pre-period device.rerouting.adaptation-weight
device.rerouting.adaptation-steps device.rerouting.adaptation-interval
device.rerouting.cch-update-threshold.factor device.rerouting.cch-update-threshold.constant
device.rerouting.cch-ensemble device.rerouting.threshold.factor device.rerouting.threshold.constant
device.rerouting.invalidation device.rerouting.with-taz device.rerouting.mode
device.rerouting.init-with-loaded-weights device.rerouting.synchronize device.rerouting.railsignal
device.rerouting.bike-speeds person-device.rerouting.probability person-device.rerouting.explicit
person-device.rerouting.deterministic person-device.rerouting.period person-device.rerouting.mode
person-device.rerouting.scope
"""
_DEVICES = """
emissions.volumetric-fuel phemlight-path phemlight-year phemlight-temperature device.emissions.probability
device.emissions.explicit device.emissions.deterministic device.emissions.begin device.emissions.period
device.stationfinder.probability device.stationfinder.explicit device.stationfinder.deterministic
device.stationfinder.rescueTime device.stationfinder.rescueAction device.stationfinder.reserveFactor
device.stationfinder.emptyThreshold device.stationfinder.radius device.stationfinder.maxEuclideanDistance
device.stationfinder.repeat device.stationfinder.chargeType device.stationfinder.waitForCharge
device.stationfinder.minOpportunityDuration device.stationfinder.saturatedChargeLevel
device.stationfinder.needToChargeLevel device.stationfinder.opportunisticChargeLevel
device.stationfinder.replacePlannedStop device.stationfinder.maxDistanceToReplacedStop
device.stationfinder.chargingStrategy device.stationfinder.checkEnergyForRoute device.battery.probability
device.battery.explicit device.battery.deterministic device.battery.track-fuel
device.elechybrid.probability device.elechybrid.explicit device.elechybrid.deterministic
device.toc.probability device.toc.explicit device.toc.deterministic device.toc.manualType
device.toc.automatedType device.toc.responseTime device.toc.recoveryRate device.toc.lcAbstinence
device.toc.initialAwareness device.toc.mrmDecel device.toc.dynamicToCThreshold
device.toc.dynamicMRMProbability device.toc.mrmKeepRight device.toc.mrmSafeSpot
device.toc.mrmSafeSpotDuration device.toc.maxPreparationAccel device.toc.ogNewTimeHeadway
device.toc.ogNewSpaceHeadway device.toc.ogMaxDecel device.toc.ogChangeRate device.toc.useColorScheme
device.driverstate.probability device.driverstate.explicit device.driverstate.deterministic
device.driverstate.initialAwareness device.driverstate.errorTimeScaleCoefficient
device.driverstate.errorNoiseIntensityCoefficient device.driverstate.speedDifferenceErrorCoefficient
device.driverstate.headwayErrorCoefficient device.driverstate.freeSpeedErrorCoefficient
device.driverstate.speedDifferenceChangePerceptionThreshold
device.driverstate.headwayChangePerceptionThreshold device.driverstate.minAwareness
device.driverstate.maximalReactionTime device.bluelight.probability device.bluelight.explicit
device.bluelight.deterministic device.bluelight.reactiondist device.bluelight.mingapfactor
device.taxi.probability device.taxi.explicit device.taxi.deterministic device.taxi.dispatch-algorithm
device.taxi.dispatch-algorithm.params device.taxi.dispatch-period device.taxi.dispatch-keep-unreachable
device.taxi.idle-algorithm device.taxi.vclasses device.glosa.probability device.glosa.explicit
device.glosa.deterministic device.glosa.range device.glosa.max-speedfactor device.glosa.min-speed
device.glosa.add-switchtime device.glosa.use-queue device.glosa.override-safety device.glosa.ignore-cfmodel
device.friction.probability device.friction.explicit device.friction.deterministic device.friction.stdDev
device.friction.offset
"""
_MESOSCOPIC = """
mesosim meso-ltm meso-edgelength meso-tauff meso-taufj meso-taujf meso-taujj meso-jam-threshold
meso-multi-queue meso-lane-queue meso-ignore-lanes-by-vclass meso-junction-control
meso-junction-control.limited meso-tls-penalty meso-tls-flow-penalty meso-minor-penalty meso-overtaking
meso-recheck meso-interpolate-pos
"""
_RANDOM = "seed thread-rngs"
SIMULATION = frozenset(
    " ".join((_INPUT, _TIME, _PROCESSING, _ROUTING, _DEVICES, _MESOSCOPIC, _RANDOM)).split()
)
"""What a simulation needs."""

_OUTPUT_FILES = """
netstate-dump emission-output battery-output elechybrid-output chargingstations-output
overheadwiresegments-output substations-output fcd-output person-fcd-output full-output queue-output
vtk-output amitran-output summary-output person-summary-output tripinfo-output personinfo-output
vehroute-output personroute-output link-output railsignal-block-output railsignal-vehicle-output bt-output
lanechange-output stop-output collision-output edgedata-output lanedata-output statistic-output
deadlock-output pedestrian.jupedsim.wkt device.rerouting.output device.ssm.file device.toc.file
device.taxi.dispatch-algorithm.output device.taxi.idle-algorithm.output log message-log error-log
"""
OUTPUT_FILES = frozenset(_OUTPUT_FILES.split())
"""What names a file that is written."""
_OUTPUT_SETTINGS = """
write-license write-metadata precision precision.geo output.compression output.format output.column-header
output.column-separator human-readable-time netstate-dump.empty-edges netstate-dump.precision
emission-output.precision emission-output.geo emission-output.step-scaled emission-output.attributes
battery-output.precision elechybrid-output.precision elechybrid-output.aggregated
chargingstations-output.aggregated chargingstations-output.aggregated.write-unfinished
substations-output.precision fcd-output.geo fcd-output.utm fcd-output.signals fcd-output.distance
fcd-output.acceleration fcd-output.speed-relative fcd-output.max-leader-distance fcd-output.params
fcd-output.filter-edges.input-file fcd-output.attributes fcd-output.filter-shapes fcd-output.skip-empty
queue-output.period queue-output.aggregation queue-output.speed-threshold queue-output.percentile
queue-output.skip-empty summary-output.period tripinfo-output.write-unfinished
tripinfo-output.write-undeparted vehroute-output.exit-times vehroute-output.last-route vehroute-output.sorted
vehroute-output.dua vehroute-output.cost vehroute-output.intended-depart vehroute-output.route-length
vehroute-output.write-unfinished vehroute-output.skip-ptlines vehroute-output.incomplete
vehroute-output.stop-edges vehroute-output.speedfactor vehroute-output.internal lanechange-output.started
lanechange-output.ended lanechange-output.xy stop-output.write-unfinished pedestrian.jupedsim.wkt.geo
device.btreceiver.probability device.btreceiver.explicit device.btreceiver.deterministic
device.btreceiver.range device.btreceiver.all-recognitions device.btreceiver.offtime
device.btsender.probability device.btsender.explicit device.btsender.deterministic
person-device.btsender.probability person-device.btsender.explicit person-device.btsender.deterministic
person-device.btreceiver.probability person-device.btreceiver.explicit
person-device.btreceiver.deterministic device.ssm.filter-edges.input-file device.ssm.probability
device.ssm.explicit device.ssm.deterministic device.ssm.measures device.ssm.thresholds
device.ssm.trajectories device.ssm.range device.ssm.extratime device.ssm.mdrac.prt device.ssm.geo
device.ssm.write-positions device.ssm.write-lane-positions device.ssm.write-na
device.ssm.exclude-conflict-types device.fcd.probability device.fcd.explicit device.fcd.deterministic
device.fcd.begin device.fcd.period device.fcd.radius person-device.fcd.probability
person-device.fcd.explicit person-device.fcd.deterministic person-device.fcd.period
device.tripinfo.probability device.tripinfo.explicit device.tripinfo.deterministic
device.vehroute.probability device.vehroute.explicit device.vehroute.deterministic
"""
OUTPUTS = OUTPUT_FILES | set(_OUTPUT_SETTINGS.split())

_PORTS = "remote-port num-clients"
_SCRIPTS = "pedestrian.jupedsim.py"
_CONFIGURATIONS = """
configuration-file save-configuration save-configuration.relative save-template save-schema save-commented
"""
_STATES = """
load-state load-state.offset load-state.remove-vehicles save-state.times save-state.period
save-state.period.keep save-state.prefix save-state.suffix save-state.files save-state.rng
save-state.transportables save-state.constraints save-state.precision
"""
"""Vehicles of a saved state have departed before an episode begins: no figure would be true."""
_NAMES_OF_OUTPUTS = "output-prefix output-suffix"
_SPEED_ALONE = "threads device.rerouting.threads astar.all-distances astar.landmark-distances"
_CHANCE = "random"
_RECORDED_TRAFFIC = """
device.fcd-replay.probability device.fcd-replay.explicit device.fcd-replay.deterministic
device.fcd-replay.files device.fcd-replay.consistency
"""
"""Vehicles that follow a recording heed no signal."""
_EXAMPLE = (
    "device.example.probability device.example.explicit device.example.deterministic device.example.parameter"
)
_PRINTED = """
verbose print-options help version xml-validation xml-validation.net xml-validation.routes no-warnings
aggregate-warnings log.timestamps log.processid language duration-log.disable duration-log.statistics
no-step-log step-log.period
"""
_SHOWN = """
gui-settings-file quit-on-end game game.mode start delay breakpoints edgedata-files alternative-net-file
selection-file demo disable-textures registry-viewport window-size window-pos tracker-interval gui-testing
gui-testing-debug gui-testing.setting-output
"""
NEVER = frozenset(
    " ".join(
        (
            *(_PORTS, _SCRIPTS, _CONFIGURATIONS, _STATES, _NAMES_OF_OUTPUTS, _SPEED_ALONE, _CHANCE),
            *(_RECORDED_TRAFFIC, _EXAMPLE, _PRINTED, _SHOWN),
        )
    ).split()
)
"""What a configuration cannot have."""
UNSAFE = {
    **dict.fromkeys(_PORTS.split(), 'backend="traci" opens the one port that is needed, on its own'),
    **dict.fromkeys(_CONFIGURATIONS.split(), "give scenario= the configuration"),
    **dict.fromkeys(_STATES.split(), "an environment has save and restore"),
    **dict.fromkeys(_CHANCE.split(), 'sumo_seed="random" draws a seed'),
    "net-file": "give scenario= or net_file= the network",
}
"""What no words of the user's can have, and what to do instead: signals would no longer be known or safe."""

_OTHER_NAMES = """
n=net-file net=net-file r=route-files routes=route-files a=additional-files additional=additional-files
w=weight-files weights=weight-files x=weight-attribute measure=weight-attribute b=begin e=end s=route-steps
srand=seed railsignal.moving-block=railsignal-moving-block carfollow.model=default.carfollowmodel
with-taz=device.rerouting.with-taz taxi.vclasses=device.taxi.vclasses
meso.ignore-lanes.by-vclass=meso-ignore-lanes-by-vclass H=human-readable-time ndump=netstate-dump
netstate=netstate-dump netstate-output=netstate-dump dump-empty-edges=netstate-dump.empty-edges
dump-precision=netstate-dump.precision summary=summary-output tripinfo=tripinfo-output
person-fcd=person-fcd-output personinfo=personinfo-output vehroutes=vehroute-output
personroutes=personroute-output statistics-output=statistic-output l=log log-file=log c=configuration-file
C=save-configuration S=save-template
"""
"""Short and old names of what may be taken."""
_OTHER_BEGINNINGS = {
    "vehroutes.": "vehroute-output.",
    "netstate-output.": "netstate-dump.",
    "netstate.": "netstate-dump.",
    "device.routing.": "device.rerouting.",
    "person-device.routing.": "person-device.rerouting.",
}
_FULL_NAMES = dict(pair.split("=") for pair in _OTHER_NAMES.split())
_MOST_NAMED = 20
_LONGEST_NAME = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Configuration:
    """What a configuration file asks for, by SUMO's full names.

    Attributes:
        files: what `FILES` name.
        options: those of `SIMULATION`, paths absolute.
        outputs: those of `OUTPUTS`; they hold where the user names a folder for them.
        left_out: the names of all others, once each, as far as there is room.
    """

    files: Mapping[str, tuple[Path, ...]]
    options: Mapping[str, str]
    outputs: Mapping[str, str]
    left_out: tuple[str, ...]


def full_name(name: str) -> str:
    """Find an option's full name, given that, a short one or an old one.

    Args:
        name: any of an option's names.

    Returns:
        The full one; what is no option comes back as it is.
    """
    for other, beginning in _OTHER_BEGINNINGS.items():
        if name.startswith(other):
            name = beginning + name.removeprefix(other)
    if name.startswith(("device.", "person-device.")) and name.endswith(".knownveh"):
        name = name.removesuffix("knownveh") + "explicit"
    return _FULL_NAMES.get(name, name)


def read_configuration(path: Path) -> Configuration:
    """Read a configuration file (.sumocfg) as SUMO does, but as data.

    Options may stand anywhere below the root, by any of their names, with `value` or `v`. Paths are relative
    to the file's folder.

    Args:
        path: of the file.

    Returns:
        What it asks for.

    Raises:
        ScenarioError: it cannot be read, an option stands in it twice, or a value asks for the environment.
    """
    found: dict[str, str] = {}
    twice: list[str] = []

    def visit(name: str, attributes: dict[str, str]) -> None:
        value = attributes.get("value") or attributes.get("v")
        if value:
            twice.extend([name] if full_name(name) in found else ())
            found[full_name(name)] = value

    read_elements(path, visit)
    if twice:
        raise ScenarioError(path, "the option stands here twice; keep one", element=twice[0][:_LONGEST_NAME])
    taken = {name: value for name, value in found.items() if name in SIMULATION | OUTPUTS or name in FILES}
    for name, value in taken.items():
        if "${" in value:
            raise ScenarioError(path, f"{value[:80]!r} asks for the environment; write it out", element=name)
    for name in READ & set(taken):
        paths = _paths(path, taken[name])
        for special in (p for p in paths if is_there(p) and not (p.is_file() or p.is_dir())):
            raise ScenarioError(special, f"{name} of {path.name} is neither a file nor a folder")
        taken[name] = ",".join(map(str, paths))
    others = [name[:_LONGEST_NAME] for name in found if name not in taken]
    more = [f"{len(others) - _MOST_NAMED} more"] if len(others) > _MOST_NAMED else []
    return Configuration(
        files={name: _paths(path, taken[name]) for name in FILES if name in taken},
        options={name: value for name, value in taken.items() if name in SIMULATION},
        outputs={name: value for name, value in taken.items() if name in OUTPUTS},
        left_out=(*others[:_MOST_NAMED], *more),
    )


def _paths(configuration: Path, names: str) -> tuple[Path, ...]:
    """List paths as SUMO does: at commas, with its own percent signs, from the configuration's folder."""
    return tuple(
        (configuration.parent / unquote(name.strip())).absolute() for name in names.split(",") if name.strip()
    )
