"""What is known of a clip before it is converted: cuts, statistics, suggestions, shots to edit."""
