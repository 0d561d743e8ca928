"""How long tests that try at random go on: short in `make test`, long with PLSYS_STRESS=1 (`make stress`).

Example: ``for step in range(rounds(ci=1000, stress=100_000)): …``
"""

from __future__ import annotations

import os

STRESS = bool(os.environ.get("PLSYS_STRESS"))


def rounds(ci: int, stress: int) -> int:
    return stress if STRESS else ci
