"""Motion in time: an assembly integrated from a start, with its contacts' laws (Sextro, chapter 4)."""
