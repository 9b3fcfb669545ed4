"""Print the OpenAPI description: ``python -m bentray_service.openapi > openapi.json``."""

import json
import sys

from .app import create_app
from .settings import ServiceSettings


def description() -> str:
    """The OpenAPI document as text; it is the same on every machine."""
    document = create_app(ServiceSettings.model_construct()).openapi()
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    sys.stdout.write(description())
