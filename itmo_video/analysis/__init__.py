"""Analysing a clip before conversion: cuts, statistics, suggestions, and a shot list to edit."""
