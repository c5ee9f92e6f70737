"""Open chains and trees of rods, solved by recursion."""
