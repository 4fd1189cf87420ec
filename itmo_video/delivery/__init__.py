"""Pictures and films to look at: HDR10 and HLG masters, stills, and views for SDR monitors."""
