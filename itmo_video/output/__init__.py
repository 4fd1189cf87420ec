"""Writing files atomically: EXR frames, folders and single files."""
