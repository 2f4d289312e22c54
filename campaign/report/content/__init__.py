"""What a report says, as data in a reader's units: no markup, no drawing."""
