"""Parts of `campaign.backends.files`: folders for a person at a rig, and returned recordings."""
