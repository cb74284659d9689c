"""microslip: modal bases of elastic bodies for vibration with friction contacts.

After W. Sextro, Dynamical Contact Problems with Friction, 2nd edition, Springer 2007.
"""

__version__ = "0.1.0"
