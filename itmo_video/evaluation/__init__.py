"""How well a conversion agrees with the truth, and how much it flickers."""
