"""The page /docs: every address, every record, nothing unescaped."""

import json

from bentray_service.openapi import description
from bentray_service.web.reference import reference_page


def test_every_address_and_record_is_written_out():
    document = json.loads(description())
    page = reference_page(document)
    for path in document["paths"]:
        assert f"<code>{path}</code>" in page
    for name in document["components"]["schemas"]:
        assert f'id="{name}"' in page


def test_text_is_escaped():
    document = json.loads(description())
    document["info"]["description"] = "<script>alert(1)</script>"
    assert "<script>" not in reference_page(document)
