"""Upsamples maps to the frame's size and applies them, span by span."""
