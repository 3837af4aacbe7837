"""Parts of documents, by the names of the terminal's JSON."""

from collections.abc import Iterator, Mapping
from typing import Any


class Record(Mapping[str, Any]):
    """A part of a document: its entries by name, as items and as attributes."""

    __slots__ = ("_entries",)

    def __init__(self, entries: Mapping[str, Any]) -> None:
        self._entries = dict(entries)

    def __getitem__(self, name: str) -> Any:
        value = self._entries[name]
        if isinstance(value, dict | list):
            # Wrapped on access, since most of a document is never accessed.
            value = self._entries[name] = _wrapped(value)
        return value

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
        return Record, (self.to_dict(),)

    def to_dict(self) -> dict[str, Any]:
        """The entries as plain dictionaries and lists."""
        return {key: _plain(value) for key, value in self._entries.items()}


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


def _wrapped(value: Any) -> Any:
    # JSON has no other types, and testing for a Mapping is slow.
    if type(value) is dict:
        return Record(value)
    if type(value) is list and value and type(value[0]) not in (float, int, str):
        return [_wrapped(entry) for entry in value]
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return value
