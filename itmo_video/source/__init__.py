"""Reading a clip, still or image sequence as numbered frames."""
