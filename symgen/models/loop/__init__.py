"""From a closed loop of links to its System."""
