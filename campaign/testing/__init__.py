"""Checks for a laboratory's own plug-ins; see `docs/developers/writing-a-backend.md`.

```python
@pytest.mark.parametrize("name", backend_checks())
def test_backend(name: str) -> None:
    backend_checks()[name](UNDER_TEST)
```

`known` registers a test's experiments, friction models, methods and backends with the program.
"""

from __future__ import annotations

from campaign.testing.backend_under_test import BackendUnderTest, Check, CheckFailedError
from campaign.testing.checks import backend_checks
from campaign.testing.kinds import known
from campaign.testing.strict_recorder import StrictRecorder

__all__ = [
    "BackendUnderTest",
    "Check",
    "CheckFailedError",
    "StrictRecorder",
    "backend_checks",
    "known",
]
