"""What experiments make of their metrics: means, tables, figures, remarks."""
