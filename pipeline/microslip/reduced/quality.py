"""How good the coordinates of a modal file are, in sentences: the numbers of `reduction.stuck` put into words."""

from __future__ import annotations

from collections.abc import Mapping

from ..data import ModalGroup


def sentences(group: ModalGroup, reduction: str) -> list[str]:
    """At most three: statics of contacts and loads, frequencies with free and with sticking contacts."""
    checks = group.checks
    found = [_statics(checks, reduction == "macneal")]
    free = _three(checks, "free_error")
    if free and max(free) > 1e-6:
        found.append(f"free contacts: its first frequencies are {_list(free)} above the certified ones")
    hertz = _three(checks, "stuck_hz")
    if hertz:
        at = ", ".join(f"{f:.5g}" for f in hertz)
        off = _three(checks, "stuck_error")
        told = f"this basis alone is off by {_list(off)}" if off else "this basis alone has no motion left"
        if off and len(off) < len(hertz):
            told += ", and has no further motion"
        if not off or len(off) < len(hertz) or max(off) > 0.01:
            told += "; what it lacks, the bulk at the contacts, a case counts with their stiffness"
        found.append(f"every contact stuck to the ground: {at} Hz; {told}")
    return [s for s in found if s]


def _statics(checks: Mapping[str, float], has_residual: bool) -> str:
    parts = []
    for key, what in (("interface", "contacts"), ("excitation", "loads"), ("monitor", "monitors")):
        error = checks.get(f"static_error_{key}")
        if error is not None:
            parts.append(f"{what} {'exact' if error < 1e-6 else f'up to {percent_off(error)} missing'}")
    tail = "; the solver adds the rest, which stands in the file" if has_residual and parts else ""
    return f"static answers at single rows: {', '.join(parts)}{tail}" if parts else ""


def _three(checks: Mapping[str, float], key: str) -> list[float]:
    return [checks[f"{key}_{i}"] for i in (1, 2, 3) if f"{key}_{i}" in checks]


def _list(errors: list[float]) -> str:
    return ", ".join(percent_off(e) for e in errors)


def percent_off(error: float) -> str:
    """An error as per cent; below what the reference resolves it is called so."""
    if error < 1e-6:
        return "less than 0.0001 %"
    return f"{100 * error:.2g} %" if error < 0.1 else f"{100 * error:.0f} %"
