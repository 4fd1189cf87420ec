"""Inner loops in C, built if there is a compiler; otherwise NumPy and OpenCV do the same."""
