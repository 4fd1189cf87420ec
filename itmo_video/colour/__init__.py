"""Colour: primaries, transfer functions, linear light, luminance."""
