"""Films and stills: HDR10 and HLG, masters for grading, and views for SDR monitors."""
