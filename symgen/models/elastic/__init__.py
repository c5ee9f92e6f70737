"""From elastic links and their elements to Systems."""
