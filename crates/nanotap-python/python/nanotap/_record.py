"""Parts of documents, by the names of the terminal's JSON."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ._describe import fields, name_in_si, observable_unit

if TYPE_CHECKING:
    from ._si import Scales

# States have several units and stay in the model's.
_STATES = frozenset({"state", "states", "start", "strobe"})
# Entries that repeat others in SI.
_IN_SI = ("_in_si", "_si")


class Record(Mapping[str, Any]):
    """A part of a document: its entries by name, as items and as attributes.

    Of a physical case numbers are in SI, except states; `units` has the unit of each, and
    `to_dict()` the document as the terminal writes it.

    Args:
        entries: The entries as in the document.
        scales: The model's units, if numbers are to be in SI.
        schema: The study and the part of its schema that describes the entries.
    """

    __slots__ = ("_entries", "_made", "_scales", "_schema")

    def __init__(
        self,
        entries: Mapping[str, Any],
        scales: "Scales | None" = None,
        schema: tuple[str, str] | None = None,
    ) -> None:
        self._entries = dict(entries)
        self._scales = scales
        self._schema = schema
        # Wrapped on access, since most of a document is never accessed.
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name in self._made:
            return self._made[name]
        value = self._entries[name]
        if self._scales is None:
            if isinstance(value, dict | list):
                value = self._made[name] = self._wrapped(name, value, None)
            return value
        if name == "physical" or name.endswith(_IN_SI):
            scales = None
        else:
            value, scales = self._in_si(name, value, self._scales)
        value = self._made[name] = self._wrapped(name, value, scales)
        other = self._entries.get(f"{name}_si")
        if isinstance(value, Record) and isinstance(other, dict):
            value._made.update((k, v) for k, v in other.items() if k in value)
        return value

    def _in_si(
        self, name: str, value: Any, scales: "Scales"
    ) -> tuple[Any, "Scales | None"]:
        """An entry in SI where it is a number, and the units that its parts are still in."""
        if name in _STATES:
            return value, scales
        physical = self._entries.get("physical")
        if isinstance(physical, dict):
            for key in (name_in_si(name), name):
                if key in physical:
                    return physical[key], None
        if not isinstance(value, dict):
            for ending in _IN_SI:
                if name + ending in self._entries:
                    return self._entries[name + ending], None
        unit = fields(*self._schema).get(name, ("", ""))[0] if self._schema else ""
        factor, _ = scales.of(unit)
        if factor != 1 and isinstance(value, float):
            return factor * value, None
        if factor != 1 and isinstance(value, list):
            return [None if one is None else factor * one for one in value], None
        return value, scales

    def _field(self, name: str) -> tuple[str, str]:
        """The declared unit of an entry as it is shown, and the part of the schema that describes
        it."""
        if self._schema is None:
            return "", ""
        study, part = self._schema
        if part.startswith("*"):
            return "", part[1:]
        known = fields(study, part)
        unit, inner = known.get(name, ("", ""))
        if self._scales is None or name in _STATES:
            return unit, inner
        physical = self._entries.get("physical")
        if isinstance(physical, dict) and name_in_si(name) in physical:
            in_si = fields(study, known["physical"][1]).get(name_in_si(name))
            if in_si is not None:
                return in_si
        return self._scales.of(unit)[1], inner

    @property
    def units(self) -> dict[str, str]:
        """The units of the entries that have one."""
        found = {name: self._unit(name) for name in self._entries}
        return {name: unit for name, unit in found.items() if unit}

    def _unit(self, name: str) -> str:
        if self._schema is not None and self._schema[1] == "Derivative":
            unit = observable_unit(name, self._scales is not None)
            key = self._entries.get("unit")
            of_one = f"({key})" if key and "/" in key else key
            return f"{unit}/{of_one}" if unit and of_one else unit
        return self._field(name)[0]

    def _wrapped(self, name: str, value: Any, scales: "Scales | None") -> Any:
        # JSON has no other types, and testing for a Mapping is slow.
        if type(value) not in (dict, list):
            return value
        part = self._field(name)[1]
        schema = (self._schema[0], part) if self._schema and part else None
        return _wrapped(value, scales, schema)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError:
            message = f"there is no `{name}`; there are {', '.join(self._entries)}"
            raise AttributeError(message) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._entries})

    def __repr__(self) -> str:
        inside = ", ".join(f"{key}={_short(value)}" for key, value in self.items())
        return f"Record({inside})"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._entries, self._scales, self._schema)

    def to_dict(self) -> dict[str, Any]:
        """The entries as plain dictionaries and lists, as in the terminal's JSON."""
        return {key: plain(value) for key, value in self._entries.items()}


# Entries of a list that are shown.
_SHOWN = 6


def _short(value: Any) -> str:
    """`repr`, of a long list or one of records its length only."""
    if isinstance(value, Record):
        return f"Record({', '.join(value)})"
    is_list = isinstance(value, list) and bool(value)
    if is_list and (len(value) > _SHOWN or isinstance(value[0], Mapping | list)):
        return f"[{len(value)} items]"
    return repr(value)


def _wrapped(
    value: Any, scales: "Scales | None", schema: tuple[str, str] | None
) -> Any:
    if type(value) is dict:
        return Record(value, scales, schema)
    if type(value) is list and value and type(value[0]) not in (float, int, str):
        return [_wrapped(entry, scales, schema) for entry in value]
    return value


def plain(value: Any) -> Any:
    """Records as dictionaries, with numbers as the records show them."""
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [plain(entry) for entry in value]
    return value
