"""Files that are written: EXR, folders, atomically."""
