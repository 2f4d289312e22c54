"""Inverse dynamics of archived motions: from trials to rows, what was found, tables, figures."""
