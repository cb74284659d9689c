"""Forced vibration with friction in the frequency domain (Sextro, chapter 5).

`response`: any law of the contact room, any number of harmonics; `reduced` eliminates the body, `patch` has the
kinematics of a rigid contact patch.
"""

from .sweeps import FrequencyResponse as FrequencyResponse
from .sweeps import peaks as peaks
