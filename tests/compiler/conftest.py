"""Makes ``hand_models`` importable from the tests below this folder (pytest puts a conftest's folder on the path)."""
