"""A clip, still or image sequence as frames by number."""
