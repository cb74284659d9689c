"""Equilibrium at speed, eigenmodes, static answers, strain and stress modes, interface rows."""

from .compute import closure_curve, modal_basis
from .foreign import foreign_basis

__all__ = ["closure_curve", "foreign_basis", "modal_basis"]
