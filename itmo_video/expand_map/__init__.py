"""The Expand Map of one keyframe: median cut, density of lights, letterbox bars."""
