"""Numbers of things in words: 1 note, 2 notes."""


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
