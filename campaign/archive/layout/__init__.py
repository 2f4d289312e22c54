"""Parts of an archive: its files, texts and checksums, for readers and writers."""
