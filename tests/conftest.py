"""One thread (the same bits at every run) and a fixed seed for the property tests."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy and MKL are loaded

from hypothesis import HealthCheck, settings

settings.register_profile(
    "microslip", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow], database=None
)
settings.load_profile("microslip")
