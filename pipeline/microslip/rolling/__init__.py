"""Rolling contact: patches of two bodies that roll on each other, and the forces of creepage and spin (Sextro, 6)."""
