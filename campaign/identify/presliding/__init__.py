"""Which recordings are small motions below breakaway, as the presliding method needs them."""
