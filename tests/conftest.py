"""Every test runs in float64 with run-time type checks on jaxtyping annotations."""

from jaxtyping import install_import_hook

install_import_hook("luenberger", "typecheck.checked")
