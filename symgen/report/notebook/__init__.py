"""What notebooks show: displays of models and results, and a widget."""
