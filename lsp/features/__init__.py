"""One file a feature; see ../README.md."""
