"""Equilibrium at speed, eigenmodes, static answers, strain and stress modes, interface rows."""

from .compute import modal_basis

__all__ = ["modal_basis"]
