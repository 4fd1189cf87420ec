"""The studio: a local page where a look is found by looking, before a long film is rendered."""
