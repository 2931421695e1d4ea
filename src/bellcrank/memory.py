"""The memory that this process can still allocate, so that what does not fit is refused before it starts."""

from __future__ import annotations

from pathlib import Path

from bellcrank.errors import InputError

SMALL = 64 * 2**20  # bytes; smaller requests are not checked
_CGROUP = Path("/sys/fs/cgroup")


def check_memory(count: int, each: float, what: str) -> None:
    """Refuse `count` items of `each` bytes that need more memory than is free. Raises InputError with how many fit."""
    free = free_memory() if count * each > SMALL else None
    if free is None or count * each <= free:
        return
    raise InputError(
        f"{count} {what} need about {_size(count * each)} of memory, {_size(free)} are free; at most "
        f"{int(free // each)} fit"
    )


def free_memory() -> int | None:
    """Bytes that this process may still take: what the machine has, and what limits of the process (`ulimit -v`) and of
    its control group leave. None where the system does not say.
    """
    found = [*_of_limits(), *_of_machine(), *_of_group()]
    return max(min(found), 0) if found else None


def _of_limits() -> list[int]:
    try:
        import resource

        pages, _, _, _, _, data, _ = map(int, Path("/proc/self/statm").read_text(encoding="ascii").split())
    except (ImportError, OSError, ValueError):
        return []
    page, free = resource.getpagesize(), []
    for kind, used in ((resource.RLIMIT_AS, pages), (resource.RLIMIT_DATA, data)):
        limit = resource.getrlimit(kind)[0]
        if limit != resource.RLIM_INFINITY:
            free.append(limit - used * page)
    return free


def _of_machine() -> list[int]:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except (OSError, ValueError):
        return []
    return [1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:")]


def _of_group() -> list[int]:
    """What control groups (version 2, or the memory controller of version 1) leave, each group and those around it."""
    try:
        lines = Path("/proc/self/cgroup").read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    except OSError:
        return []
    free = []
    for line in lines:
        _, _, rest = line.partition(":")
        controllers, _, group = rest.partition(":")
        if controllers == "":
            root, names, prefix = _CGROUP, ("memory.max", "memory.current"), ""
        elif "memory" in controllers.split(","):
            root, names = _CGROUP / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes")
            prefix = "total_"
        else:
            continue
        inner = root / group.lstrip("/")
        for folder in (inner, *inner.parents):
            if not folder.is_relative_to(root):
                break
            try:
                limit, taken = (int((folder / name).read_text(encoding="ascii")) for name in names)
                stat = dict(line.split() for line in (folder / "memory.stat").read_text(encoding="ascii").splitlines())
                cached = sum(int(stat[f"{prefix}{kind}_file"]) for kind in ("active", "inactive"))
            except (OSError, ValueError, KeyError):  # no such group here, or no limit ("max")
                continue
            free.append(limit - taken + cached)  # files that are cached make room
    return free


def _size(count: float) -> str:
    return f"{count / 1e9:.3g} GB" if count >= 1e8 else f"{count / 1e6:.3g} MB"
