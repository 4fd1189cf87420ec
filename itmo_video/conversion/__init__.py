"""Converting one clip to one folder of EXR files."""
