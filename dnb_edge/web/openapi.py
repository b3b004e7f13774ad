"""The API's OpenAPI document, made from the same table as its routes.

Knows endpoints and pydantic's schemas; knows no handler.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from dnb_edge import __version__
from dnb_edge.web.endpoint import API, Access, Endpoint
from dnb_edge.web.guard_answers import ErrorAnswer
from dnb_edge.web.guard_door import CSRF_HEADER, SAFE_METHODS
from dnb_edge.web.sessions import COOKIE

_ABOUT = f"""Everything that the pages do goes through this. Members are added to answers, never taken away or changed: ignore
those that you do not know. Whatever fails answers with an `ErrorAnswer`.

To change something, `POST {API}/login` with the set-up code, keep the cookie, and send the answer's `csrf` as `X-CSRF-Token`.

The live stream is a WebSocket at `{API}/live?since=N&epoch=E`; see docs/api.md."""

_PARAMETER = re.compile(r"\{(\w+)\}")
_ID = {"type": "string", "pattern": r"^[A-Za-z0-9_~-][A-Za-z0-9._~-]{0,199}$"}


def document(table: Iterable[Endpoint]) -> dict[str, Any]:
    """The OpenAPI 3.1 document of the endpoints that belong to the API."""
    endpoints = [endpoint for endpoint in table if endpoint.in_api]
    ins = {model for endpoint in endpoints for model in (endpoint.body, endpoint.query) if model is not None}
    outs = {endpoint.answer for endpoint in endpoints if endpoint.answer is not None} | {ErrorAnswer}
    wanted: list[tuple[type[BaseModel], Any]] = [
        *((model, "validation") for model in sorted(ins, key=_name)),
        *((model, "serialization") for model in sorted(outs, key=_name)),
    ]
    references, definitions = models_json_schema(wanted, ref_template="#/components/schemas/{model}")
    paths: dict[str, Any] = {}
    for endpoint in endpoints:
        paths.setdefault(endpoint.path, {})[endpoint.method.lower()] = _operation(endpoint, references)
    return {
        "openapi": "3.1.0",
        "info": {"title": "dnb-edge", "version": __version__, "description": _ABOUT},
        "paths": paths,
        "components": {
            "schemas": definitions.get("$defs", {}),
            "securitySchemes": {
                "session": {"type": "apiKey", "in": "cookie", "name": COOKIE},
                "token": {"type": "apiKey", "in": "header", "name": CSRF_HEADER},
            },
        },
    }


def endpoint(table: Iterable[Endpoint]) -> Endpoint:
    """The document's own address; `table`: all others."""
    whole: list[Endpoint] = list(table)

    @cache
    def made() -> dict[str, Any]:
        return document(whole)

    async def handler(_request: Request) -> Response:
        return JSONResponse(made())

    own = Endpoint(
        method="GET",
        path=f"{API}/openapi.json",
        access=Access.ALL,
        handler=handler,
        summary="This document",
        answer_types=("application/json",),
    )
    whole.append(own)
    return own


def _operation(endpoint: Endpoint, references: dict[Any, Any]) -> dict[str, Any]:
    changes = endpoint.method not in SAFE_METHODS
    operation: dict[str, Any] = {
        "summary": endpoint.summary,
        "operationId": _identifier(endpoint),
        "parameters": [
            *(
                {"name": name, "in": "path", "required": True, "schema": _ID}
                for name in _PARAMETER.findall(endpoint.path)
            ),
            *_query(endpoint),
        ],
        "responses": {
            "2XX": {"description": "Done.", "content": _answer(endpoint, references)},
            "default": {
                "description": "Refused or failed.",
                "content": {"application/json": {"schema": references[ErrorAnswer, "serialization"]}},
            },
        },
    }
    if endpoint.access is Access.CHANGE:
        operation["security"] = [{"session": [], "token": []} if changes else {"session": []}]
    if endpoint.body is not None:
        schema = references[endpoint.body, "validation"]
        operation["requestBody"] = {"required": True, "content": {"application/json": {"schema": schema}}}
    elif endpoint.body_types:
        content = {kind: {"schema": {"type": "string", "format": "binary"}} for kind in endpoint.body_types}
        operation["requestBody"] = {"required": True, "content": content}
    return operation


def _query(endpoint: Endpoint) -> list[dict[str, Any]]:
    if endpoint.query is None:
        return []
    schema = endpoint.query.model_json_schema(ref_template="#/components/schemas/{model}")
    required = set(schema.get("required", ()))
    return [
        {
            "name": name,
            "in": "query",
            "required": name in required,
            "description": part.get("description", ""),
            "schema": _without_null({key: value for key, value in part.items() if key != "description"}),
        }
        for name, part in schema.get("properties", {}).items()
    ]


def _without_null(schema: dict[str, Any]) -> dict[str, Any]:
    """The schema of a parameter that is left out, never null."""
    options = [option for option in schema.get("anyOf", ()) if option != {"type": "null"}]
    if len(options) != 1:
        return schema
    return {**{key: value for key, value in schema.items() if key not in {"anyOf", "default"}}, **options[0]}


def _answer(endpoint: Endpoint, references: dict[Any, Any]) -> dict[str, Any]:
    content: dict[str, Any] = {}
    if endpoint.answer is not None:
        content["application/json"] = {"schema": references[endpoint.answer, "serialization"]}
        others: tuple[str, ...] = tuple(kind for kind in endpoint.answer_types if kind != "text/html")
    else:
        others = endpoint.answer_types
    for kind in others:
        content.setdefault(kind, {"schema": {}})
    return content


def _identifier(endpoint: Endpoint) -> str:
    words = re.sub(r"\W+", "_", endpoint.path.removeprefix(API)).strip("_")
    return f"{endpoint.method.lower()}_{words}"


def _name(model: type[BaseModel]) -> str:
    return f"{model.__module__}.{model.__qualname__}"
