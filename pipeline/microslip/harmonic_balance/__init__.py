"""Forced vibration with friction in the frequency domain (Sextro, chapter 5).

`response`: any law of the contact room, any number of harmonics; `reduced` eliminates the body, `patch` has the
kinematics of a rigid contact patch. `jenkins`: one harmonic, linear normal contact and one Jenkins element a contact,
in closed form; the only one that needs no jax, so the names below are its own.
"""

from .jenkins import JenkinsContact as JenkinsContact
from .jenkins import Residual as Residual
from .jenkins import frequency_response as frequency_response
from .jenkins import jenkins_harmonic as jenkins_harmonic
from .jenkins import refined_peaks as refined_peaks
from .jenkins import stuck_frequencies as stuck_frequencies
from .jenkins import stuck_resonances as stuck_resonances
from .sweeps import FrequencyResponse as FrequencyResponse
from .sweeps import peaks as peaks
from .sweeps import response_table as response_table
