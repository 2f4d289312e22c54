"""What a lab tests its own kinds with; `docs/developers/writing-a-backend.md` shows how.

```python
@pytest.mark.parametrize("name", backend_checks())
def test_backend(name: str) -> None:
    backend_checks()[name](UNDER_TEST)
```

`known` makes experiments, friction models, methods and backends of a test known to the program.
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
