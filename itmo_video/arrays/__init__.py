"""Pictures as NumPy arrays: expanded without files, or read from a converted folder."""
