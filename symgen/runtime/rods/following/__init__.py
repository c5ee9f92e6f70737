"""Driven linkages over a range of their drives: compiled steps, the curve by arc length, singular poses."""
