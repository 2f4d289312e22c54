"""The page: numbered content and drawings, rendered by templates."""
