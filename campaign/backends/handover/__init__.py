"""What `campaign.backends.files` is made of: folders for a person at a rig, and what comes back."""
