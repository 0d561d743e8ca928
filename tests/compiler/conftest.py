"""Makes ``hand_models`` (in this folder) and ``random_scenes`` (one above) importable from the tests below."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
