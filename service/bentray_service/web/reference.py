"""The OpenAPI description, and the page /docs: a REST reference generated from it."""

from collections.abc import Iterator
from html import escape
from typing import Any

from fastapi import FastAPI

from ..errors import PROBLEMS
from .curl_examples import add_examples
from .documents import document, table
from .errors import EDGE, FAILED, INTERNAL, INVALID_REQUEST, NOT_FOUND


class OpenApiApp(FastAPI):
    """A FastAPI application whose description has no null parameters, and an example of each operation.

    FastAPI describes an optional parameter with the default None as null, but queries and headers cannot be
    null.
    """

    def openapi(self) -> dict[str, Any]:
        """The description, generated once."""
        made = self.openapi_schema is None
        document = super().openapi()
        if made:
            _drop_null(document)
            add_examples(document)
        return document


def _drop_null(document: dict[str, Any]) -> None:
    for operations in document["paths"].values():
        for operation in operations.values():
            for parameter in operation.get("parameters", ()):
                schema = parameter["schema"]
                kinds = [one for one in schema.pop("anyOf", ()) if one != {"type": "null"}]
                if len(kinds) == 1:
                    parameter["schema"] = {**kinds[0], **schema}
                elif kinds:
                    schema["anyOf"] = kinds


Node = dict[str, Any]

EXAMPLE = """curl --data-binary @scan.h5 http://127.0.0.1:8000/v1/datasets

curl -H 'Content-Type: application/json' http://127.0.0.1:8000/v1/jobs \\
     -d '{"kind": "reconstruction", "dataset": "ds-…", "settings": {"rays": "curved"}}'

curl http://127.0.0.1:8000/v1/jobs/job-…

curl -o slice.png http://127.0.0.1:8000/v1/volumes/vol-…/slice.png

# If authentication is required, every request except /health needs a key:
curl -H "Authorization: Bearer $BENTRAY_KEY" http://127.0.0.1:8000/v1/access"""


# Default description of FastAPI.
UNSAID = "Successful Response"


def reference_page(description: Node) -> str:
    """The OpenAPI document as one HTML page."""
    operations = list(_operations(description))
    contents = "".join(
        f'<li><a href="#{_anchor(o)}"><code>{o[0].upper()} {escape(o[1])}</code></a></li>' for o in operations
    )
    schemas = description["components"]["schemas"]
    content = f"""<p>{escape(description["info"]["description"])}</p>
<h2>In four steps</h2><pre tabindex="0">{escape(EXAMPLE)}</pre>
<h2>Addresses</h2><ul class="toc">{contents}</ul>
{"".join(_operation(o) for o in operations)}
<h2 id="problems">Problems</h2>
<p>Every error is <code>application/problem+json</code> (RFC 9457).</p>
{_problems()}
<h2>Records</h2>
{"".join(_schema(name, schemas[name]) for name in sorted(schemas))}"""
    return document("REST reference", description["info"]["version"], content)


def _operations(description: Node) -> Iterator[tuple[str, str, Node]]:
    for path, methods in description["paths"].items():
        for method, operation in methods.items():
            yield method, path, operation


def _anchor(operation: tuple[str, str, Node]) -> str:
    return escape(str(operation[2]["operationId"]))


def _operation(operation: tuple[str, str, Node]) -> str:
    method, path, what = operation
    parts = [
        f'<section class="panel" id="{_anchor(operation)}"><h3 class="path">'
        f'<span class="method {method}">{method.upper()}</span> <code>{escape(path)}</code></h3>',
        f"<p>{escape(what.get('description', ''))}</p>",
    ]
    parts += [f'<pre tabindex="0">{escape(sample["source"])}</pre>' for sample in what["x-codeSamples"]]
    if parameters := what.get("parameters"):
        known = [(p["name"], p["in"], type_words(p["schema"]), p.get("description", "")) for p in parameters]
        parts.append(table(("Parameter", "In", "Type", "Meaning"), known))
    if body := what.get("requestBody"):
        parts.append("<h3>Body</h3>")
        bodies = [(media, type_words(content["schema"])) for media, content in body["content"].items()]
        parts.append(table(("Media type", "Content"), bodies))
    responses = [
        (code, _answer(response), "" if response["description"] == UNSAID else response["description"])
        for code, response in what["responses"].items()
        if code != "default"
    ]
    parts.append("<h3>Answers</h3>" + table(("Status", "Content", "Meaning"), responses))
    return "".join(parts) + "</section>"


def _answer(response: Node) -> str:
    return "; ".join(
        type_words(content.get("schema", {})) if media.endswith("json") else media
        for media, content in response.get("content", {}).items()
    )


def type_words(schema: Node) -> str:
    """A short description of a JSON schema."""
    if "$ref" in schema:
        return str(schema["$ref"]).rpartition("/")[2]
    if "anyOf" in schema:
        return " or ".join(type_words(one) for one in schema["anyOf"])
    if "const" in schema:
        return f'"{schema["const"]}"'
    if "enum" in schema:
        return " or ".join(f'"{value}"' for value in schema["enum"])
    if "prefixItems" in schema:
        return "[" + ", ".join(type_words(one) for one in schema["prefixItems"]) + "]"
    if schema.get("type") == "array":
        return f"list of {type_words(schema.get('items', {}))}"
    limits = [
        f"{words} {schema[key]}" for key, words in (("minimum", "≥"), ("maximum", "≤")) if key in schema
    ]
    name = str(schema.get("format") or schema.get("type", "any"))
    return f"{name} {', '.join(limits)}".rstrip()


def _schema(name: str, schema: Node) -> str:
    required = schema.get("required", [])
    rows = []
    for field, what in schema.get("properties", {}).items():
        default = f", default {what['default']}" if what.get("default") is not None else ""
        need = " (required)" if field in required else ""
        rows.append((field, type_words(what) + default + need, what.get("description", "")))
    about = "".join(f"<p>{escape(text)}</p>" for text in schema.get("description", "").split("\n\n")[:1])
    fields = table(("Field", "Type", "Meaning"), rows)
    return f'<section class="panel" id="{escape(name)}"><h3>{escape(name)}</h3>{about}{fields}</section>'


def _problems() -> str:
    kinds = [*PROBLEMS, *EDGE, INVALID_REQUEST, NOT_FOUND, FAILED, INTERNAL]
    return table(
        ("Type", "Status", "Title"), [(f"/problems/{k.slug}", str(k.status), k.title) for k in kinds]
    )
