"""Carries the map between frames: cuts, optical flow, keyframes."""
