"""JSON Schema (draft 7) of mappings: protocols with `[columns.NAME]` and `[[test.recording]]`."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel

from campaign.importing.mapping import TIME, ChannelColumn, RecordingEntry, TimeColumn
from campaign.protocol.json_schema import Tree, protocol_schema, schema_of_model
from campaign.protocol.schema import ExperimentKind

TABLES: dict[str, type[BaseModel]] = {
    "TimeColumn": TimeColumn,
    "ChannelColumn": ChannelColumn,
    "Recording": RecordingEntry,
}


def mapping_schema(experiments: Mapping[str, ExperimentKind]) -> Tree:
    """Schema of a mapping with these experiments."""
    tree = protocol_schema(experiments)
    for name, model in TABLES.items():
        table = schema_of_model(model)
        tree["definitions"] |= {**table.pop("definitions"), name: table}
    layout = {
        "type": "object",
        "properties": {TIME: {"$ref": "#/definitions/TimeColumn"}},
        "additionalProperties": {"$ref": "#/definitions/ChannelColumn"},
    }
    tree["properties"]["columns"]["additionalProperties"] = layout
    test = tree["properties"]["test"]["items"]
    for table in (test, *(case["then"] for case in test["allOf"])):
        recording = table["properties"]["recording"]
        table["properties"]["recording"] = {
            **recording,
            "items": {"$ref": "#/definitions/Recording"},
        }
    return {**tree, "title": "A mapping of campaign"}
