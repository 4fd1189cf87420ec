"""The studio: a local web page for finding a look by eye before a long film is rendered."""
