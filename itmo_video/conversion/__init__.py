"""One clip to one folder of EXR files."""
