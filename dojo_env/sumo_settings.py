"""What SUMO is run with: defaults, then the scenario's own options, then what the user asks for.

Nothing of a scenario's configuration gives way in silence: `SumoSettings.notes` name it.
"""

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from dojo_env.errors import ConfigError, ScenarioError
from dojo_env.scenario import Scenario
from dojo_env.sumo_options import UNSAFE, full_name
from dojo_maps.signals.programs import read_seconds

DEFAULTS = {
    "max-depart-delay": "-1",
    "waiting-time-memory": "1000",
    "time-to-teleport": "-1",
    "step-length": "1",
    "device.tripinfo.probability": "1",
    "no-step-log": "true",
    "xml-validation": "never",
    "xml-validation.net": "never",
}
"""What holds where nobody says otherwise; some differ from SUMO's own."""
_USUAL_DURATION = 3600.0
"""Seconds, where the scenario tells no end."""
_USUAL_INTERVAL = 5.0
"""Seconds from decision to decision, where nobody says otherwise."""
_SHORTEST_STEP = 0.001
"""Seconds: SUMO counts in milliseconds."""
_TIMES = ("begin", "end", "step-length", "max-depart-delay", "waiting-time-memory", "time-to-teleport")


@dataclass(frozen=True, slots=True, kw_only=True)
class SumoSettings:
    """SUMO's options and the times of an episode, all in seconds.

    Attributes:
        options: by SUMO's full names, without the scenario's files, and without a seed unless the user names
            one on SUMO's command line.
        begin: of the episode.
        end: of the episode.
        step: the length of SUMO's steps.
        interval: from decision to decision, a whole number of steps.
        seed: what the scenario or the user has SUMO use where no seed is given; None where they do not say.
        files: route and additional files that the user names on SUMO's command line.
        notes: what gives way to what the user asks for, in a line each.
    """

    options: Mapping[str, str]
    begin: float
    end: float
    step: float
    interval: float
    seed: int | None = None
    files: Mapping[str, tuple[Path, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def settle(
    scenario: Scenario,
    given: Mapping[str, object],
    words: str,
    *,
    seconds: float | None,
    interval: float | None,
) -> SumoSettings:
    """Put the options together.

    Args:
        scenario: whose own options hold where the user says nothing.
        given: what the user asks for by arguments, by SUMO's names; None says nothing.
        words: what the user asks for as on SUMO's command line.
        seconds: how long an episode lasts; None leaves that to the scenario.
        interval: seconds from decision to decision; None takes 5, or the next whole number of steps.

    Returns:
        The options, and the times of an episode.

    Raises:
        ConfigError: a value is none, or a time is no whole number of SUMO's steps.
        ScenarioError: a value of the scenario's is none.
    """
    typed = read_words(words)
    asked = {**{name: str(value) for name, value in given.items() if value is not None}, **typed}
    own = {**scenario.options, "begin": str(scenario.begin)}
    merged = {**DEFAULTS, **own, **asked}
    times = {name: _time(merged[name], name, scenario, asked) for name in _TIMES if name in merged}
    begin, step = times["begin"], times["step-length"]
    if not _SHORTEST_STEP <= step <= _USUAL_DURATION:
        raise ConfigError(f"step-length {merged['step-length']}: expected 0.001 to 3,600 s; SUMO's own is 1")
    end = _find_end(scenario, asked, times.get("end", -1.0), begin, seconds)
    if seconds is not None and "end" in merged:
        merged["end"] = asked["end"] = f"{end:.3f}".rstrip("0").rstrip(".")
    seed = merged.get("seed", "")
    if seed and not seed.isdecimal():
        raise _unusable("seed", seed, scenario, asked)
    if "seed" not in typed:
        merged.pop("seed", None)  # Each episode has its own.
    settled_interval = _settle_interval(interval, step)
    if seconds is not None and not _is_whole(seconds / settled_interval):
        raise ConfigError(
            f"num_seconds={seconds} is no multiple of delta_time={settled_interval:g}; change one"
        )
    return SumoSettings(
        options=merged,
        begin=begin,
        end=end,
        step=step,
        interval=settled_interval,
        seed=int(seed) if seed else None,
        files={
            name: tuple(Path(path) for path in typed[name].split(","))
            for name in ("route-files", "additional-files")
            if name in typed
        },
        notes=_note_overridden(scenario, asked),
    )


def read_words(text: str) -> dict[str, str]:
    """Read options as they stand on SUMO's command line, by their full names.

    `--name value`, `--name=value`, `-n value`, and `--name` alone, which says true.

    Args:
        text: the options.

    Returns:
        Values by full name.

    Raises:
        ConfigError: a word belongs to no option, or an option is none that a user may set here.
    """
    found: dict[str, str] = {}
    name = ""
    for word in _split(text):
        if word.startswith("-") and not _is_number(word):
            written, equals, value = word.lstrip("-").partition("=")
            name = full_name(written)
            if name in UNSAFE:
                raise ConfigError(f"additional_sumo_cmd: {written} cannot be set here; {UNSAFE[name]}")
            found[name] = value if equals else "true"
            name = "" if equals else name
        elif name:
            found[name], name = word, ""
        else:
            raise ConfigError(f"additional_sumo_cmd: {word!r} belongs to no option; write --name value")
    return found


def _split(text: str) -> list[str]:
    try:
        return shlex.split(text)
    except ValueError as error:
        raise ConfigError(f"additional_sumo_cmd={text!r}: {error}") from None


def _time(text: str, name: str, scenario: Scenario, asked: Mapping[str, str]) -> float:
    try:
        return read_seconds(text)
    except ValueError:
        raise _unusable(name, text, scenario, asked) from None


def _unusable(name: str, text: str, scenario: Scenario, asked: Mapping[str, str]) -> ConfigError:
    words = f"{name} {text[:80]!r}: expected a number of seconds, h:m:s or d:h:m:s"
    if name == "seed":
        words = f"seed {text[:80]!r}: expected a whole number from 0"
    own = scenario.config is not None and name not in asked
    return ScenarioError(scenario.config, words) if own and scenario.config else ConfigError(words)


def _find_end(
    scenario: Scenario, asked: Mapping[str, str], end: float, begin: float, seconds: float | None
) -> float:
    if seconds is not None:
        return begin + seconds
    if "end" not in asked:
        end = -1.0 if scenario.end is None else scenario.end
    if end < 0:
        return begin + _USUAL_DURATION
    if end <= begin:
        raise ConfigError(
            f"scenario {scenario.name}: it ends at {end:g} s, before it begins at {begin:g} s; "
            "change begin_time, or give num_seconds"
        )
    return end


def _settle_interval(interval: float | None, step: float) -> float:
    if interval is None:
        return round(math.ceil(round(_USUAL_INTERVAL / step, 6)) * step, 3)
    if not _is_whole(interval / step):
        raise ConfigError(f"delta_time={interval} is no multiple of SUMO's step of {step:g} s; change one")
    return interval


def _note_overridden(scenario: Scenario, asked: Mapping[str, str]) -> tuple[str, ...]:
    name = scenario.name if scenario.config is None else scenario.config.name
    return tuple(
        f"{name}: {option} {scenario.options[option]} gives way to {value}, as you ask"
        for option, value in asked.items()
        if option in scenario.options and not _same(scenario.options[option], value)
    )


def _same(one: str, other: str) -> bool:
    if one == other:
        return True
    try:
        return read_seconds(one) == read_seconds(other)
    except ValueError:
        return False


def _is_whole(count: float) -> bool:
    return abs(count - round(count)) < 1e-6


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
