"""Settings of all tests."""

from hypothesis import HealthCheck, settings

# Machines are noisy: a deadline would make the clock part of the law. The same examples each time, so that a red run
# stays red.
settings.register_profile(
    "midair", deadline=None, derandomize=True, max_examples=40, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("midair")
