"""How often Python searches for objects that nothing refers to any more."""

import gc


def search_seldom() -> None:
    """Let a process search less often: imports and compiling make much that stays.

    Searching it again and again takes a fifth of the time of compiling.
    """
    gc.set_threshold(50_000, 20, 20)
