"""The platform's mathematics: bench, friction, compensation, and the engine that integrates them.

Knows nothing of files, commands, protocols or archives.
"""
