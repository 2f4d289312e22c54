"""JSON Schema (draft 7) of protocols and benches, so that editors complete and check TOML.

It defines tables, keys and words, and that a quantity is text with a number and a unit. Permitted
units depend on the axis, and the consistency of values on the whole file: `campaign plan` and
`campaign check` check these.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema

from campaign.choice import Choice
from campaign.options import TextFile, meaning_of
from campaign.physics.bench import Bench
from campaign.protocol.files import SCHEMA
from campaign.protocol.schema import ExperimentKind, ProtocolFile, TestEntry
from campaign.units import Quantity

DIALECT = "http://json-schema.org/draft-07/schema#"
QUANTITY = r"^\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?(/[1-9]\d*)?(\s+\S|[^\s\d.]).*$"
"""A number, or a fraction, and a unit."""
BOUNDS = ("gt", "ge", "lt", "le", "exclusiveMinimum", "minimum", "exclusiveMaximum", "maximum")
"""Bounds of a quantity: in SI, and thus not applicable to text."""
Tree = dict[str, Any]


class _Generator(GenerateJsonSchema):
    """Generator with quantities, choices between tables, and docstrings of fields."""

    def function_before_schema(self, schema: Any) -> Tree:
        owner = getattr(schema["function"]["function"], "__self__", None)
        return _quantity(owner) if isinstance(owner, Quantity) else self._inner(schema["schema"])

    def function_plain_schema(self, schema: Any) -> Tree:
        owner = getattr(schema["function"]["function"], "__self__", None)
        if isinstance(owner, Choice):
            return self._choice(owner)
        if owner is TextFile:
            return {"type": "string"}
        return {}

    def default_schema(self, schema: Any) -> Tree:
        """Without defaults, which are in SI: the description states the essential."""
        return self._inner(schema["schema"])

    def nullable_schema(self, schema: Any) -> Tree:
        """Without null, which TOML lacks: a missing value is absent."""
        return self._inner(schema["schema"])

    def model_schema(self, schema: Any) -> Tree:
        tree: Tree = super().model_schema(schema)
        model = schema["cls"]
        for name, each in tree.get("properties", {}).items():
            each.pop("title", None)
            if name in model.model_fields and (meaning := meaning_of(model, name)):
                tree["properties"][name] = _described(each, meaning)
        return tree

    def _choice(self, choice: Choice) -> Tree:
        tables = choice.tables()
        return {
            "type": "object",
            "required": [choice.tag],
            "properties": {choice.tag: {"enum": list(tables)}},
            "allOf": [
                {
                    "if": {"properties": {choice.tag: {"const": word}}, "required": [choice.tag]},
                    "then": self._inner(table.__pydantic_core_schema__),
                }
                for word, table in tables.items()
            ],
        }

    def _inner(self, schema: Any) -> Tree:
        return dict(self.generate_inner(schema))


def _quantity(quantity: Quantity) -> Tree:
    units = quantity.accepts + (quantity.linear.accepts if quantity.linear else ())
    text = f"A {quantity.name}, such as {quantity.example}; units: {', '.join(units)}."
    return {"type": "string", "pattern": QUANTITY, "description": text}


def _described(schema: Tree, text: str) -> Tree:
    """A schema with the field's text before that of its quantity, or beside a reference."""
    if "$ref" in schema:
        return {"allOf": [schema], "description": text}
    own = schema.get("description", "")
    return {**schema, "description": f"{text} {own}".strip()}


def _cleaned(tree: Any) -> Any:
    """A schema without bounds on text, and without titles, which repeat names."""
    if isinstance(tree, list):
        return [_cleaned(each) for each in tree]
    if not isinstance(tree, dict):
        return tree
    dropped = BOUNDS if tree.get("type") == "string" else ()
    return {
        name: {key: _cleaned(each) for key, each in value.items()}
        if name in ("properties", "$defs", "definitions")
        else _cleaned(value)
        for name, value in tree.items()
        if name not in dropped and not (name == "title" and isinstance(value, str))
    }


def schema_of_model(model: type[BaseModel]) -> Tree:
    """Schema of one table; referenced tables are under `definitions`."""
    tree: Tree = model.model_json_schema(
        schema_generator=_Generator, ref_template="#/definitions/{model}"
    )
    tree["definitions"] = tree.pop("$defs", {})
    cleaned: Tree = _cleaned(tree)
    return cleaned


def bench_schema() -> Tree:
    """Schema of a bench file."""
    tree = schema_of_model(Bench)
    definitions = tree["definitions"]
    definitions["Scatter"] = {"anyOf": [{"type": "number"}, definitions["Scatter"]]}
    gear = definitions["GearOptions"]
    gear["required"], gear["oneOf"] = [], [{"required": ["ratio"]}, {"required": ["lead"]}]
    _named_by_key(tree["properties"]["compensation"], definitions)
    tree["properties"]["schema"] = {"const": SCHEMA["bench"]}
    return {"$schema": DIALECT, "title": "A bench of campaign", **tree}


def _named_by_key(table: Tree, definitions: Mapping[str, Tree]) -> None:
    """Make the tag optional in entries with the name of a kind: `[compensation.observer]`."""
    choice = table["additionalProperties"]
    (tag,) = choice["required"]
    table["properties"] = {}
    for case in choice["allOf"]:
        word = case["if"]["properties"][tag]["const"]
        own = definitions[case["then"]["$ref"].rpartition("/")[2]]
        required = [name for name in own.get("required", ()) if name != tag]
        table["properties"][word] = {**own, "required": required}


def protocol_schema(experiments: Mapping[str, ExperimentKind]) -> Tree:
    """Schema of a protocol with these experiments; a test's keys depend on its kind."""
    top, entry = schema_of_model(ProtocolFile), schema_of_model(TestEntry)
    definitions = {**top.pop("definitions"), **entry.pop("definitions")}
    cases = []
    for name, kind in experiments.items():
        own = schema_of_model(kind.options)
        definitions |= own.pop("definitions")
        properties = {**own.get("properties", {}), **entry["properties"]}
        required = [*entry.get("required", ()), *own.get("required", ())]
        then = {"properties": properties, "required": required, "additionalProperties": False}
        given = {"properties": {"kind": {"const": name}}, "required": ["kind"]}
        cases.append({"if": given, "then": then})
    test = {**entry, "additionalProperties": True, "allOf": cases}
    test["properties"] = {**entry["properties"], "kind": {"enum": list(experiments)}}
    top["properties"]["schema"] = {"const": SCHEMA["protocol"]}
    top["properties"]["test"] = {"type": "array", "items": test}
    return {
        "$schema": DIALECT,
        "title": "A protocol of campaign",
        **top,
        "definitions": definitions,
    }
