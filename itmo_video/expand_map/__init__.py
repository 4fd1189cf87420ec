"""The Expand Map of one key: median cut, density of lights, letterbox bars."""
