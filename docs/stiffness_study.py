"""Contact stiffness in one picture and one table: when a layer is a spring, when it yields, how contacts slip."""

from __future__ import annotations

from typing import Any

import numpy as np

from microslip.contact.hertz import Hertz
from microslip.contact.layer import BOUNDARIES, Layer, quasi_static_error
from microslip.contact.partial_slip import PartialSlip
from microslip.contact.profiles import Profile, RoundContact
from microslip.contact.solids import Solid

STEEL = Solid(2.1e11, 0.3)
COLOURS = dict(zip(BOUNDARIES, ("#0b4f9c", "#d98410", "#5a8f3c"), strict=True))


def layers() -> tuple[list[str], list[list[str]]]:
    """The contact of the test blade of 5.3, 72 x 5 mm on 90 mm of steel, by what holds its sides."""
    head = ["sides", "c_N0, N/m", "c_R0, N/m", "first normal, Hz", "first tangential, Hz", "error at 700 Hz", "1 % at"]
    rows = []
    for boundary in BOUNDARIES:
        layer = Layer(STEEL, 0.09, boundary, 7850)
        m = layer.quasi_static(700.0)
        n, t = (float(f(0.072 * 0.005)) for f in (layer.normal_stiffness, layer.tangential_stiffness))
        rows.append([
            boundary, f"{n / 1e6:.1f}e6", f"{t / 1e6:.1f}e6", f"{m.first_normal:.0f}", f"{m.first_tangential:.0f}",
            f"{100 * m.error:.2f} %", f"{m.allowed:.0f} Hz",
        ])  # fmt: skip
    return head, rows


def picture(fig: Any, plain: Any) -> Any:
    """Left: error over frequency. Middle: largest friction coefficient. Right: first loading to full slip."""
    left, middle, right = fig.subplots(1, 3)
    for axes in (left, middle, right):
        plain(axes)
    _frequency(left)
    _yield(middle)
    _slip(right)
    return fig


def _frequency(axes: Any) -> None:
    r = np.geomspace(0.01, 0.95, 200)
    axes.loglog(r, [100 * quasi_static_error(x) for x in r], color="#0b4f9c", label="exact, tan(x)/x - 1")
    axes.loglog(r, 100 * np.pi**2 / 12 * r**2, color="0.5", ls="--", label="(π²/12) (f/f₁)²")
    axes.plot(700 / 8910, 100 * quasi_static_error(700 / 8910), "o", color="#c8382c")
    axes.annotate("5.3: 700 of 8910 Hz", (700 / 8910, 0.51), (0.011, 1.2), color="#c8382c", fontsize=9)
    axes.set_xlabel("frequency over first eigenfrequency")
    axes.set_ylabel("static stiffness too large by, %")
    axes.set_ylim(1e-2, 1e2)
    axes.legend(frameon=False, fontsize=9, loc="lower right")


def _yield(axes: Any) -> None:
    p = np.linspace(0.05, 4, 400)
    for boundary in BOUNDARIES:
        layer = Layer(STEEL, 0.01, boundary)
        axes.plot(p, layer.largest_friction(p, 1.0), color=COLOURS[boundary], label=boundary)
    axes.set_ylim(0, 3)
    axes.set_xlim(0, 4)
    axes.set_xlabel("pressure over yield stress in shear")
    axes.set_ylabel("largest friction coefficient")
    axes.legend(frameon=False, fontsize=9)


def _slip(axes: Any) -> None:
    cone = Profile.of_function(lambda r: 0.01 * r, 5e-3)
    blunt = Profile.of_function(lambda r: 0.01 * np.maximum(r - 1.5e-4, 0), 5e-3, corners=[1.5e-4])
    stamp = Profile.of_table([0, 1e-3, 2e-3], [0, 0, 0])
    shapes: dict[str, Any] = {
        "sphere, ellipse (Hertz)": Hertz.sphere(STEEL, STEEL, 0.05),
        "cone": RoundContact(STEEL, STEEL, cone),
        "blunt cone": RoundContact(STEEL, STEEL, blunt),
        "flat stamp": RoundContact(STEEL, STEEL, stamp, edge=True),
    }
    x = np.linspace(0, 1.15, 116)
    for (name, contact), colour in zip(shapes.items(), ("#0b4f9c", "#d98410", "#5a8f3c", "#c8382c"), strict=True):
        s = PartialSlip(contact, 200.0, 0.3)
        axes.plot(x, s.force(x * s.full_slip) / s.limit, color=colour, label=name)
    axes.set_xlabel("displacement over that of full slip")
    axes.set_ylabel("tangential force over μ F_N")
    axes.legend(frameon=False, fontsize=9, loc="lower right")
