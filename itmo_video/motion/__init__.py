"""What carries the map: cuts, optical flow, keyframes."""
