"""Programs in SUMO's words: its times, offsets, rings and barriers."""

import pytest

from dojo_maps.description import Program
from dojo_maps.signals.nema import list_cycle, list_pairs, show, unroll
from dojo_maps.signals.programs import GREEN, YELLOW, following, is_green, read_program, read_seconds

RINGS = {"ring1": "1,2", "ring2": "5,6", "barrierPhases": "2,6", "barrier2Phases": "2,6"}
NEMA_PHASES = [
    {"duration": "9", "minDur": "5", "yellow": "4", "red": "1", "name": name, "state": state}
    for name, state in (("1", "Grrr"), ("2", "rGrr"), ("5", "rrGr"), ("6", "rgrG"))
]


def nema(**parameters: str) -> Program:
    return read_program({"id": "A", "type": "NEMA"}, NEMA_PHASES, {**RINGS, **parameters})


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("42", 42), ("1.5", 1.5), ("0:00:42", 42), ("1:02:03", 3723), ("1:00:00:00.5", 86400.5), ("-5", -5)],
)
def test_read_seconds_knows_the_clock(text: str, seconds: float) -> None:
    assert read_seconds(text) == seconds


@pytest.mark.parametrize("text", ["", "begin", "1:2", "1:2:3:4:5", "nan", "1e400", "1::2"])
def test_read_seconds_refuses_what_is_no_time(text: str) -> None:
    with pytest.raises(ValueError, match=r"time|float"):
        read_seconds(text)


def test_read_program_takes_the_begin_for_an_offset_of_none() -> None:
    program = read_program({"offset": "begin"}, [{"duration": "0:01:00", "state": "G", "next": "0 7"}], {})
    assert (program.offset, program.phases[0].duration, program.phases[0].following) == (0.0, 60.0, (0,))


@pytest.mark.parametrize("phase", [{"state": "G"}, {"duration": "-1", "state": "G"}, {"duration": "5"}])
def test_read_program_refuses_phases_without_a_time_or_state(phase: dict[str, str]) -> None:
    with pytest.raises(ValueError, match=r"duration|state"):
        read_program({}, [phase], {})


def test_rings_name_places_by_side_of_the_barrier() -> None:
    assert nema().rings == (((0, 1),), ((2, 3),))
    assert nema(ring1="1,0,2,0").rings == (((0,), (1,)), ((2, 3),))


@pytest.mark.parametrize("parameters", [{"ring1": ""}, {"ring2": "5,8"}])
def test_rings_that_sumo_refuses_are_none(parameters: dict[str, str]) -> None:
    assert nema(**parameters).rings == ()


def test_pairs_stay_on_one_side_of_the_barrier() -> None:
    program = read_program(
        {"type": "NEMA"},
        [{"duration": "9", "state": "G" * k, "name": str(k)} for k in range(1, 9)],
        {"ring1": "1,2,3,4", "ring2": "5,6,7,8"},
    )
    names = [tuple(place + 1 for place in pair) for pair in list_pairs(program)]
    assert names == [(1, 5), (1, 6), (2, 5), (2, 6), (3, 7), (3, 8), (4, 7), (4, 8)]
    assert [tuple(place + 1 for place in pair) for pair in list_cycle(program)] == [
        (1, 5),
        (2, 6),
        (3, 7),
        (4, 8),
    ]


def test_show_prefers_priority() -> None:
    assert [show(nema(), pair) for pair in ((0, 2), (1, 3))] == ["GrGr", "rGrG"]


def test_unroll_ends_every_green_with_the_movement_s_own_yellow_and_red() -> None:
    program = unroll(nema())
    assert [phase.state for phase in program.phases[:4]] == ["GrGr", "GgrG", "rGGr", "rGrG"]
    for place, phase in enumerate(program.phases):
        for after in following(program, place):
            then = program.phases[after]
            lost = [b for a, b in zip(phase.state, then.state, strict=True) if a in GREEN and b not in GREEN]
            assert set(lost) <= YELLOW
            if YELLOW & set(phase.state):
                assert phase.duration == 4
                assert then.duration == 1
                assert not YELLOW & set(then.state)


def test_unroll_leaves_other_programs_alone() -> None:
    program = read_program({}, [{"duration": "9", "state": "G"}], {})
    assert unroll(program) is program


def test_is_green_knows_yellow_and_signals_that_are_off() -> None:
    assert [is_green(state) for state in ("Gr", "gs", "Gy", "rr", "Gu", "oO")] == [True, True] + [False] * 4
