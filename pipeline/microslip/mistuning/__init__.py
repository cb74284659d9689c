"""Rings whose blades and contacts differ: samples of whole rings, what of them is highest, statistics (Sextro 5.6)."""
