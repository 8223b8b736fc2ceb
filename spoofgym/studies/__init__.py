"""Programs that print the tables of one paper or of one page."""
