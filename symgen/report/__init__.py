"""Tables, plots and equations for people to look at."""
