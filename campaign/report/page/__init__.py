"""The page: content and drawings, numbered, and filled into templates."""
