"""Brings the map up to a frame's size and applies it, span by span."""
