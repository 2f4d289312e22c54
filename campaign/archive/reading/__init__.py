"""Reading untrusted archives: damaged items are reported, the others are available."""
