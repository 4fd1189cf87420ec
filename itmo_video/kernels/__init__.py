"""Inner loops in C, for where a compiler was found; without them NumPy and OpenCV do the same."""
