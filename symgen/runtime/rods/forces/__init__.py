"""Joint forces and section forces in driven linkages of rigid links."""
