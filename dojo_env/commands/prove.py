"""The command `dojo-env prove`: no actions make a map's signals unsafe."""

import argparse

from dojo_env.commands.options import read_yellow
from dojo_maps.command import Commands, add_command
from dojo_maps.wording import counted


def add_prove(commands: Commands) -> None:
    """Add the command to the parser.

    Args:
        commands: what `add_subparsers` made; the command is added to it.
    """
    prove = add_command(
        commands,
        "prove",
        _prove,
        "prove that no actions make a map's signals unsafe",
        example="dojo-env prove cologne1 --all-red 1",
    )
    prove.add_argument("scenario", help="a packaged scenario, a .sumocfg, a bundle or a network")
    prove.add_argument("--signals", nargs="+", metavar="ID", help="the signals to look at (default: all)")
    prove.add_argument("--yellow", type=read_yellow, default=2, metavar="S", help='seconds, or "speed"')
    prove.add_argument("--all-red", type=int, default=0, metavar="S", help="seconds between yellow and green")
    prove.add_argument(
        "--min-green", type=int, default=10, metavar="S", help="seconds of green before a change"
    )
    prove.add_argument("--max-green", type=int, metavar="S", help="seconds of green before the next phase")
    prove.add_argument(
        "--walking-speed", type=float, default=1.2, metavar="M/S", help="of the slowest walker"
    )
    prove.add_argument(
        "--phases", choices=["program", "computed"], default="program", help="which to choose from"
    )


def _prove(options: argparse.Namespace) -> int:
    """Visit every state of every signal in every action mode; returns 1 where a rule is broken."""
    from dojo_env.config import ACTION_MODES, SignalConfig
    from dojo_env.managers.map import MapManager
    from dojo_env.scenario import find_map, open_map
    from dojo_env.signals.proof import prove

    found = find_map(options.scenario)
    configs = [
        SignalConfig(
            ts_ids=options.signals,
            action_mode=mode,
            yellow_time=options.yellow,
            all_red=options.all_red,
            min_green=options.min_green,
            max_green=options.max_green,
            walking_speed=options.walking_speed,
            phases=options.phases,
        )
        for mode in ACTION_MODES
    ]
    plans = MapManager(open_map(found), configs[0], additional=found.additional).plans
    states = proved = 0
    print("result    phases    states  longest change  signal")
    for signal, plan in plans.items():
        proofs = [prove(plan, config) for config in configs]
        visited = sum(proof.states for proof in proofs)
        broken = [(proof.mode, example) for proof in proofs for example in proof.counterexamples]
        states, proved = states + visited, proved + (not broken)
        result = "VIOLATED" if broken else "proved"
        longest = max(proof.longest_change for proof in proofs)
        print(f"{result:8}{len(plan.phases):8}{visited:10}{longest:14g} s  {signal}", flush=True)
        for mode, example in broken:
            print(f"  {mode}: {example}")
    signals = counted(len(plans), "signal")
    print(f"{found.name}: {proved} of {signals} proved in every action mode, {counted(states, 'state')}")
    return int(proved < len(plans))
