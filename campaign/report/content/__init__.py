"""Content of a report as data in display units, without markup and drawing."""
