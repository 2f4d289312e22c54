"""Methods of identification: one file each."""
