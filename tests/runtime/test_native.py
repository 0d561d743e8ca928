"""The C unit tests, each plain and under the address and undefined-behaviour sanitizers."""

from pathlib import Path

import native
import pytest

SOURCES = sorted(path.name for path in Path(__file__).parent.glob("test_*.c"))


@pytest.mark.parametrize("variant", native.VARIANTS)
@pytest.mark.parametrize("source", SOURCES)
def test_c_unit_test_passes(source, variant):
    done = native.run(native.build(source, variant))
    assert done.returncode == 0, done.stdout + done.stderr
