"""Every test runs in float64 with run-time type checks on jaxtyping annotations."""

from hypothesis import settings
from jaxtyping import install_import_hook

install_import_hook("luenberger", "typecheck.checked")

# The same examples on every machine, and no limit on the time of one: compilation falls on whichever comes first.
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")
