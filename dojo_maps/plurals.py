"""Numbers of things in words: 1 note, 2 notes, 1,200 vehicles."""


def counted(number: int, thing: str, things: str | None = None) -> str:
    """Say how many there are.

    Args:
        number: of them.
        thing: what one is called.
        things: what several are called, where that is not an s more.

    Returns:
        The number, thousands set apart, and the word.
    """
    return f"{number:,} {thing if number == 1 else things or f'{thing}s'}"
