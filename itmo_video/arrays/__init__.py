"""Pictures as NumPy arrays: expanded without files, and read back from a converted folder."""
