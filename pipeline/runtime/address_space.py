"""How much memory the system lets a program address: with too little, libraries end it.

LLVM, which compiles, and threads that find no room for their data, end the process without an
exception, so that nothing can be said then.
"""

ENOUGH = 3e9  # bytes; 2.9e9 are addressed in `run --overlay`, of which 0.6e9 are used


def shortage() -> str | None:
    """Message about a limit that is too low; None: there is no such limit."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY or limit >= ENOUGH:
        return None
    return (
        f"warning: this shell or job lets a program address {limit / 1e9:.1f} GB of memory only: "
        f"expected {ENOUGH / 1e9:.0f} GB or more; with less the program may end at any moment "
        "without a message: raise the limit (`ulimit -v unlimited`, or in the job's request)"
    )
