"""Which engine computed a recording."""

from __future__ import annotations

ENGINE = 1
"""Raised by every change that changes a simulated sample of any trial: integration, friction,
scatter, noise, sensors, controllers, compensation, base motion. Not by what is faster or told
better. The changelog then says which results change and why; a change that forgot is noticed by
`tests/physics/test_engine_version.py`.
"""
