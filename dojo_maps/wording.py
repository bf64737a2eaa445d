"""Words of messages: how many there are of a thing (1 note, 2 notes), and which name was meant."""

from collections.abc import Iterable
from difflib import get_close_matches


def counted(number: int, thing: str, things: str = "") -> str:
    """Say how many there are.

    Args:
        number: of them.
        thing: what one is called.
        things: what several are called, where that is not an s more.

    Returns:
        The number and the word.
    """
    return f"{number} {thing if number == 1 else things or f'{thing}s'}"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Ask for the known name that is like an unknown one.

    Args:
        name: what was given.
        known: what there is.

    Returns:
        `; did you mean max-pressure?`, to end a message with; nothing where no name is like it.
    """
    near = get_close_matches(name[:80], list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""
