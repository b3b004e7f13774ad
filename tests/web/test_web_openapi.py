"""The OpenAPI document: complete, valid, true, and nothing that it allows to be sent breaks the box."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema_rs
import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis.specs.openapi.checks import content_type_conformance, response_schema_conformance
from starlette.applications import Starlette
from web_box import log_in, settings_in, visitor

from dnb_edge.web.app import make_app
from dnb_edge.web.endpoint import API, Access
from dnb_edge.web.guard_rates import Limits
from dnb_edge.web.openapi import document

EXAMPLES = 3
"""Of each operation and kind, so that all of it takes seconds."""
CHECKS = [content_type_conformance, response_schema_conformance]


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Starlette:
    """The application under the name by which schemathesis calls it, on empty folders."""
    folder: Path = tmp_path_factory.mktemp("box")
    return make_app(settings_in(folder, names=("testserver",)), limits=Limits(per_s=0.0, wrong_codes=((10**6, 60.0),)))


@pytest.fixture(scope="module")
def found(app: Starlette) -> dict[str, Any]:
    answer = visitor(app).get(f"{API}/openapi.json")
    assert answer.status_code == 200
    return dict(answer.json())


def test_every_endpoint_of_the_api_is_in_it(app: Starlette, found: dict[str, Any]) -> None:
    """And nothing else."""
    there = {(method.upper(), path) for path, methods in found["paths"].items() for method in methods}
    assert there == {(one.method, one.path) for one in app.state.table if one.in_api}
    assert found == json.loads(json.dumps(document(app.state.table)))


def test_every_operation_says_who_may_and_how_it_fails(app: Starlette, found: dict[str, Any]) -> None:
    """A session for what is not for all, the token where something changes, and one error for everything."""
    for endpoint in app.state.table:
        if not endpoint.in_api:
            continue
        operation = found["paths"][endpoint.path][endpoint.method.lower()]
        names = {name for one in operation.get("security", ()) for name in one}
        changes = endpoint.access is Access.CHANGE
        assert names == ({"session"} if changes else set()) | (
            {"token"} if changes and endpoint.method != "GET" else set()
        )
        error = operation["responses"]["default"]["content"]["application/json"]["schema"]
        assert error == {"$ref": "#/components/schemas/ErrorAnswer"}
        assert operation["summary"]
        assert ("requestBody" in operation) == (endpoint.body is not None or bool(endpoint.body_types))


def test_operations_have_names_of_their_own(found: dict[str, Any]) -> None:
    """As generators of clients want it."""
    names = [operation["operationId"] for methods in found["paths"].values() for operation in methods.values()]
    assert len(set(names)) == len(names)


def test_its_schemas_are_schemas(found: dict[str, Any]) -> None:
    """JSON Schema 2020-12, with every reference leading somewhere."""
    schemas = found["components"]["schemas"]
    for schema in schemas.values():
        jsonschema_rs.meta.validate({"$schema": "https://json-schema.org/draft/2020-12/schema", **schema})
    for reference in _references(found):
        assert reference.removeprefix("#/components/schemas/") in schemas


def _references(value: Any) -> list[str]:
    if isinstance(value, dict):
        own = [value["$ref"]] if isinstance(value.get("$ref"), str) else []
        return own + [one for part in value.values() for one in _references(part)]
    return [one for part in value for one in _references(part)] if isinstance(value, list) else []


@pytest.mark.parametrize("mode", list(schemathesis.GenerationMode))
def test_whatever_is_sent_is_answered_as_the_document_says(app: Starlette, mode: schemathesis.GenerationMode) -> None:
    """What it allows, and what it does not: never a failure inside, always the type and the schema that it promises."""
    client = visitor(app)
    headers = {"X-CSRF-Token": log_in(client), "Cookie": "; ".join(f"{k}={v}" for k, v in client.cookies.items())}
    schema = schemathesis.openapi.from_asgi(f"{API}/openapi.json", app)
    bounded = settings(
        max_examples=EXAMPLES,
        database=None,
        derandomize=True,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    called = 0
    for result in schema.get_all_operations():
        operation = result.ok()
        if operation.path == f"{API}/logout":
            # It would end the session of all others.
            continue

        def ask(case: schemathesis.Case) -> None:
            answer = case.call(headers=headers)
            # 503: the daemon is down, and says so.
            assert answer.status_code < 500 or answer.status_code == 503, (case, answer.text)
            case.validate_response(answer, checks=CHECKS)

        if mode is schemathesis.GenerationMode.NEGATIVE and not _has_input(operation):
            continue
        bounded(given(case=operation.as_strategy(generation_mode=mode))(ask))()
        called += 1
    assert called >= 20


def _has_input(operation: Any) -> bool:
    """Whether anything about a request to it can be wrong."""
    return bool(operation.body or operation.query or operation.path_parameters)
