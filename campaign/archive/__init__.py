"""The archive: a run in progress is a crash-safe folder; a sealed run is one file.

`writing.writer.RunWriter` writes, `reading.open_run` reads, `reading.run_list` searches a results
folder. The format: `docs/developers/archive-format.md`.
"""
