"""Report texts and tables of the planned analyses."""
