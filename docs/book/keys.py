"""The page of all keys of study files, from the schema that the program prints."""

import json
import subprocess

#: The kinds of studies: the definition in the schema, and the heading of its part of the page.
KINDS = {
    "MovingMesh2": "moving-mesh in the plane",
    "MovingMesh": "moving-mesh on a line, where it differs",
    "PoissonStudy": "poisson",
    "StefanStudy": "stefan",
    "EquidistributionStudy": "equidistribution",
}
HEAD = """# Every key

This page is made from the schema that `driftmesh schema` prints, whenever the book is built. *Values* that stand in
alternatives are separated by “or”. A key without a default is either required or optional; `driftmesh check STUDY.toml`
prints what holds in a given study. [The study](study.md) explains the keys in the order in which one needs them. A
table that several kinds of study share word for word stands with the first of them.

"""


def words(text):
    """A description in one line of a table: without examples and links of the documentation in Rust."""
    text = text.split("# Example")[0].split("```")[0]
    for mark in ("[`", "`]"):
        text = text.replace(mark, "`")
    while "](" in text:
        before, _, rest = text.partition("](")
        text = before.replace("[", "", 1) + rest.partition(")")[2]
    return " ".join(text.split()).replace("|", "\\|").replace("$", "\\$").replace("<", "&lt;")


class Page:
    """The tables of the page, one for each table of a study."""

    def __init__(self, schema):
        self.definitions = schema["$defs"]
        self.lines = []
        self.seen = set()

    def meant(self, schema):
        """What a reference stands for, with a description beside it kept, and without the alternative `null`."""
        while True:
            others = [s for s in schema.get("anyOf", []) if s.get("type") != "null"]
            if len(others) == 1:
                schema = others[0] | {k: v for k, v in schema.items() if k != "anyOf"}
            elif "$ref" in schema:
                found = self.definitions[schema["$ref"].rsplit("/", 1)[1]]
                schema = found | {k: v for k, v in schema.items() if k != "$ref"}
            else:
                return schema

    def values(self, schema, depth=0):
        """The values that a key takes, in words."""
        schema = self.meant(schema)
        alternatives = schema.get("anyOf") or schema.get("oneOf")
        if alternatives:
            return " or ".join(dict.fromkeys(self.values(one, depth) for one in alternatives))
        if "const" in schema:
            return f"`{json.dumps(schema['const'], ensure_ascii=False)}`"
        if "enum" in schema:
            return " or ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
        if "properties" in schema:
            if "kind" in schema["properties"]:
                return f"`{{ kind = {self.values(schema['properties']['kind']).strip('`')}, … }}`"
            return "`{ " + ", ".join(f"{key} = …" for key in schema["properties"]) + " }`"
        names = schema.get("type", "anything")
        names = [name for name in ([names] if isinstance(names, str) else names) if name != "null"]
        if names == ["array"]:
            length = schema.get("minItems") if schema.get("minItems") == schema.get("maxItems") else None
            inner = self.values(schema.get("items", {}), depth + 1)
            inner = {"number": "numbers", "integer": "integers", "text": "texts"}.get(inner, inner)
            return f"{length} {inner}" if length and " " not in inner else f"{length or 'a list'} of ({inner})"
        if names == ["object"]:
            return "a table by names"
        return " or ".join({"string": "text", "boolean": "true or false"}.get(name, name) for name in names)

    def row(self, name, schema):
        """A line of a table: a key, its values, its default and its meaning."""
        meant = self.meant(schema)
        default = meant.get("default")
        shown = "" if default is None else "`" + json.dumps(default, ensure_ascii=False) + "`"
        about = words(meant.get("description", ""))
        self.lines.append(f"| `{name}` | {self.values(schema)} | {shown} | {about} |")

    def table(self, title, schema, level):
        """A table of keys, and below it those of the tables and of the kinds within."""
        meant = self.meant(schema)
        kinds = [self.meant(one) for one in meant.get("oneOf", [])]
        if kinds and all("kind" in kind.get("properties", {}) for kind in kinds):
            for kind in kinds:
                name = self.meant(kind["properties"]["kind"])["const"]
                rest = {key: value for key, value in kind["properties"].items() if key != "kind"}
                head = f"{title}, kind = \"{name}\""
                self.keys(head, kind.get("description", ""), rest, level)
        else:
            self.keys(title, "", meant.get("properties", {}), level)

    def keys(self, title, about, properties, level):
        """The heading, the description and the rows of a table, then the tables that it holds."""
        if title == "data":
            about = "A table from a file for each name, which every formula may then call as a function"
        begin = len(self.lines)
        self.lines += ["", f"{'#' * level} `{title}`", ""]
        if about:
            self.lines += [f"What it is: {words(about).rstrip('.')}.", ""]
        if properties:
            self.lines += ["| key | values | default | meaning |", "|---|---|---|---|"]
            for name, schema in properties.items():
                self.row(name, schema)
        # a table that an earlier kind of study has too is there only once
        table = "\n".join(self.lines[begin:])
        if table in self.seen:
            del self.lines[begin:]
        self.seen.add(table)
        prefix = title.split(",")[0]
        for name, schema in properties.items():
            meant = self.meant(schema)
            kinds = [self.meant(one) for one in meant.get("oneOf", [])]
            tables = bool(kinds) and all("kind" in kind.get("properties", {}) for kind in kinds)
            if tables or (len(meant.get("properties", {})) > 2 and meant.get("type") == "object"):
                self.table(f"{prefix}.{name}", schema, level)

    def study(self, definition, title):
        """All tables of a kind of study."""
        self.lines += ["", f"## {title}"]
        for name, schema in self.meant({"$ref": f"#/$defs/{definition}"})["properties"].items():
            if name != "study":
                self.table(name, schema, 3)


def page(program):
    """The page, with the schema of this program."""
    schema = json.loads(subprocess.run([program, "schema"], capture_output=True, check=True).stdout)
    out = Page(schema)
    out.lines += ["## Every study", "", "| key | values | default | meaning |", "|---|---|---|---|"]
    for name, key in out.meant(schema["properties"]["study"])["properties"].items():
        out.row(f"study.{name}", key)
    for definition, title in KINDS.items():
        out.study(definition, title)
    return HEAD + "\n".join(out.lines) + "\n"
