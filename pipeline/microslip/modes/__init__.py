"""Equilibrium at speed, eigenmodes, static answers, strain and stress modes, interface rows."""

from .compute import modal_basis
from .foreign import foreign_basis

__all__ = ["foreign_basis", "modal_basis"]
