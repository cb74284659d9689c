"""Numbers of the section on microslip in docs/contact.md."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from microslip.contact.heights import Polynomial
from microslip.contact.hertz import Hertz
from microslip.contact.law import march
from microslip.contact.microslip import MonotoneSlip
from microslip.contact.sliders import mindlin, rough_strips
from microslip.contact.solids import Solid

MU, C_N0, C_R0, R_Z = 0.3, 2.4e8, 0.9e8, 12e-6
STEEL = Solid(2.1e11, 0.3)
BALL = Hertz(STEEL, STEEL, 20.0, 20.0)


def errors() -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Largest error of the strips' tangential force against the closed form, over mu F_N at the largest approach."""
    w, level = np.linspace(0, 1.6, 161)[:, None], np.linspace(0.1, 1.5, 15)
    exact = MonotoneSlip(Polynomial(), C_R0 / (MU * C_N0), 1.0).force(w, level)
    u = jnp.asarray(R_Z * np.stack(np.broadcast_arrays(level, w, 0.0), axis=-1))
    rows = []
    for count in (4, 8, 16, 32, 64):
        strips = rough_strips(C_N0, R_Z, Polynomial(), C_R0, MU, count)
        force = np.array(march(strips, u, 1.0, strips.init(15))[0])[..., 1] / (MU * C_N0 * R_Z)
        ball = mindlin(BALL, MU, 8e-6, count)
        x = np.linspace(0, 8e-6, 2001)
        excess = np.array(ball.local(jnp.asarray(x))[0]) - BALL.force(x)
        rows.append((
            str(count), f"{100 * np.abs(force - exact).max():.2g} %", f"{100 * excess.max() / BALL.force(8e-6):.2g} %"
        ))  # fmt: skip
    return ("sliders", "rough strips, all of Fig. 3.8-2 a", "sphere, normal force"), rows
