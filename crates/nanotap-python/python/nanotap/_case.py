"""The case: cantilever, sample and drive."""

import errno
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from . import _nanotap
from ._quantity import in_si, si_unit, text, written
from ._record import Record
from ._report import frame

if TYPE_CHECKING:
    import pandas as pd

    from ._explore import Explorer

Path: TypeAlias = str | os.PathLike[str]
Scalar: TypeAlias = "float | str | np.floating[Any] | np.integer[Any] | None"
Table: TypeAlias = (
    "pd.DataFrame | Mapping[str, Iterable[float]] | Iterable[Iterable[float | str]]"
)
Value: TypeAlias = "Scalar | Mapping[str, Scalar | Table | Mapping[str, Scalar]]"

_OTHER_NAMES = {
    alias: name
    for table, keys in _nanotap.case_keys()
    if table == "model"
    for name, alias, _ in keys
}


# Entries of `to_dict` that follow from the keys.
_FOLLOWS = {"period", "physical"}

# Each fixes the distance of a physical case: a new one replaces the other.
_FIX_THE_DISTANCE = {"gap.tip", "drive.setpoint"}

# Entries of the document that do not depend on the distance.
_WITHOUT_DISTANCE = {"kind", "modes", "contact", "actuation", "cosine_term"}


# Typed as a value of a key: a mapping with keys that is passed by `**` would be refused otherwise.
def _flag(model_units: Value) -> bool:
    if not isinstance(model_units, bool):
        raise TypeError(f"model_units: expected True or False, got {model_units!r}")
    return model_units


class Case:
    """A checked case: a cantilever (dimensionless or in physical units) or an oscillator.

    Keys are those of the case file. Dimensionless: `modes`, `alpha1` … `alpha6`, `omega`,
    or their readable names (`tip_mass_ratio`, `drive_amplitude`, `beam_damping`,
    `contact_stiffness`, `gap`, `contact_damping`, `drive_frequency`). Physical: the tables
    as dictionaries, with quantities and their units: texts (`"10 nm"`), numbers in SI (`1e-8`), or
    quantities of pint, astropy or unyt. A force curve, `sample={"law": "table", "table": …}`,
    is the path of a CSV file, or its columns as a dictionary or a pandas table with units in the
    names: `{"gap (nm)": […], "force (nN)": […]}`; so are relaxing arms (`arms`, `relaxation_arms`). Measured
    modes are dictionaries: `cantilever={"mode": [{"f": "48.9 kHz", "k": "0.9 N/m", "Q": 255}, …]}`.
    A force of your own is a formula of the gap `d` and its rate `v` with its parameters:
    `sample={"law": "formula", "force": "k*max(-d, 0) - c*v", "parameters": {"k": "5 N/m", "c": 1e-7}}`;
    `sample_force="…"` is short for law and force.

    >>> Case(alpha1=0.1, alpha2=0.1, alpha3=0.1, alpha4=20, alpha6=0.2, omega=2.6).omega
    2.6
    >>> case = Case(
    ...     cantilever={"k": "2.8 N/m", "f0": "75 kHz", "Q": 200},
    ...     sample={"stiffness": "20 N/m"},
    ...     drive={"frequency": "65.7 kHz", "free_amplitude": "20 nm"},
    ...     gap={"tip": "10 nm"},
    ... )
    >>> round(case.alpha4, 2)
    21.43
    >>> case.drive.free_amplitude, case["gap.tip"]
    ('20 nm', '10 nm')

    Raises:
        ValueError: a key or value is invalid; the message names it and a remedy.
        TypeError: a value is neither number nor text.
    """

    __slots__ = ("_core", "_document", "_is_at_setpoint", "_keys", "_remarks_said")
    _core: _nanotap.CaseCore
    _keys: dict[str, str]
    _document: Record
    _is_at_setpoint: bool

    def __init__(
        self,
        *,
        catalogue: Path | Iterable[Path] = (),
        model_units: Value = False,
        **keys: Value,
    ) -> None:
        texts = [
            (os.fspath(path), _nanotap.catalogue_text(existing(path)))
            for path in _paths(catalogue)
        ]
        self._make(None, key_words(keys), texts, "", _flag(model_units))

    @classmethod
    def from_file(
        cls,
        path: Path,
        *,
        catalogue: Path | Iterable[Path] = (),
        model_units: Value = False,
        **keys: Value,
    ) -> "Case":
        """The case of a TOML file, with `keys` replacing its values.

        `catalogue` names files with further levers and materials; with `model_units` results of
        a physical case are in the model's units.

        >>> with open("case.toml", "w") as file:
        ...     size = file.write(Case.paper().to_toml())
        >>> Case.from_file("case.toml", omega=20).omega
        20.0
        """
        case = cls.__new__(cls)
        case._keys = key_words(keys)
        files = [existing(path) for path in _paths(catalogue)]
        case._core = _nanotap.CaseCore.from_file(
            existing(path), list(case._keys.values()), files
        ).in_model_units(_flag(model_units))
        case._read()
        return case

    @classmethod
    def from_toml(cls, text: str, *, name: str = "case", **keys: Value) -> "Case":
        """The case of a TOML text, called `name` in error messages.

        >>> Case.from_toml(Case.paper().to_toml()) == Case.paper()
        True
        """
        if not isinstance(text, str):
            message = f"text: expected a TOML text, got {text!r}"
            raise TypeError(message)
        return _again(cls, (name, text), key_words(keys), [], "", False)

    @classmethod
    def paper(cls, **keys: Value) -> "Case":
        """The paper's parameters for Figs. 5–17, Eq. (26), with α₁ = 0.1 and Ω = 2.6.

        >>> Case.paper(omega=20).drive_frequency
        20.0
        """
        own: dict[str, Value] = {
            "modes": 3,
            "alpha1": 0.1,
            "alpha2": 0.1,
            "alpha3": 0.1,
            "alpha4": 20.0,
            "alpha5": 0.0,
            "alpha6": 0.2,
            "omega": 2.6,
        }
        return _again(cls, None, key_words(own) | key_words(keys), [], "", False)

    def with_(
        self,
        changes: Mapping[str, Value] | None = None,
        /,
        *,
        model_units: Value = None,
        **keys: Value,
    ) -> "Case":
        """The same case with some keys changed; `None` removes a key. Keys with a dot go into a
        mapping, as in `case.with_({"gap.tip": "12 nm"})`. Numbers that are not stated
        follow: of a case with `free_amplitude` the drive follows a new frequency. In the
        arguments of a study a key varies alone: there the drive's own amplitude stays.
        A distance replaces a setpoint, and a setpoint a distance, here and there.

        >>> Case.paper().with_(omega=3).omega
        3.0
        """
        keys = {**(changes or {}), **keys}
        in_model = self._core.model_units if model_units is None else _flag(model_units)
        if not keys and in_model == self._core.model_units:
            return self
        source, _, catalogues, folder = self._core.made_of
        new = key_words(keys, self.kind)
        for name in new.keys() & set(self._own_parameters):
            # A number without a unit has that of the parameter.
            number = new[name].partition("=")[2]
            if number and not number.startswith('"'):
                unit = _nanotap.si_unit_of(str(self[name]))
                new[name] = f"{name}={number} {unit}".rstrip()
        replaced = _FIX_THE_DISTANCE if _FIX_THE_DISTANCE & new.keys() else set()
        kept = {key: text for key, text in self._keys.items() if key not in replaced}
        return _again(
            type(self), source, kept | new, catalogues, os.fspath(folder), in_model
        )

    def _varied(self, keys: Mapping[str, Value]) -> "Case":
        """The same case with keys varied as studies vary them: what is not varied stays, the
        drive's own amplitude too. It is made for one study and is not kept.
        """
        if not keys:
            return self
        texts = key_words(keys, self.kind)
        case = type(self).__new__(type(self))
        case._keys = self._keys | texts
        case._core = self._core.varied(list(texts), list(texts.values()))
        case._read()
        return case

    def _make(
        self,
        source: tuple[str, str] | None,
        words: dict[str, str],
        catalogues: list[tuple[str, str]],
        folder: str,
        model_units: bool,
    ) -> None:
        self._keys = words
        core = _nanotap.CaseCore(source, list(words.values()), catalogues, folder)
        self._core = core.in_model_units(model_units)
        self._read()

    def _read(self) -> None:
        self._document = Record(json.loads(self._core.document))
        self._is_at_setpoint = not self._core.leaves_distance_to_setpoint

    @property
    def _solved(self) -> Record:
        """The document of the case; where the distance is left to a setpoint, it is solved for."""
        if not self._is_at_setpoint:
            self._document = Record(json.loads(self._core.document_at_setpoint))
            self._is_at_setpoint = True
        return self._document

    @property
    def kind(self) -> str:
        """`cantilever`, `vibro_impact` or `impact`."""
        return str(self._document["kind"])

    @property
    def period(self) -> float:
        """The period of the drive, 2π/Ω, in the model's unit of time."""
        return float(self["period"])

    @property
    def physical(self) -> Record | None:
        """Quantities in SI (frequencies in Hz), if it is a physical case.

        Where the distance is left to a setpoint, it is solved for.
        """
        physical = self._solved.get("physical")
        return physical if isinstance(physical, Record) else None

    @property
    def is_physical(self) -> bool:
        """Whether it was given in physical units."""
        return self._core.is_physical

    @property
    def remarks(self) -> list[tuple[str, str]]:
        """Assumptions (`note`) and warnings (`warning`)."""
        return self._core.remarks

    @property
    def setpoint_distances(self) -> Record | None:
        """Every distance at which an orbit has the setpoint amplitude, and the one that the
        feedback finds (`chosen`), for a physical case with a setpoint and without `gap.tip`,
        whose distance is solved for when it is first studied. Otherwise `None`.
        """
        text = self._core.setpoint
        return None if text is None else Record(json.loads(text))

    @property
    def state_names(self) -> list[str]:
        """The names of the entries of a state: a1 … aN, v1 … vN; or x, v."""
        return self._core.state_names

    @property
    def mapping(self) -> "pd.DataFrame":
        """Every dimensionless parameter and the physical quantity that it represents.

        Columns: parameter, value, formula, quantity, si, unit. Empty without physical units. Where the
        distance is left to a setpoint, it is solved for.
        """
        import pandas as pd

        columns = ["parameter", "value", "formula", "quantity", "si", "unit"]
        table = self.tables.get("mapping", pd.DataFrame(columns=columns))
        return table[columns].set_index("parameter")

    @property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """The tables that `nanotap case` prints: `numbers` of a dimensionless case; of a physical one
        `mapping`, `equilibria` where the sample attracts, and `solutions` where the distance is left
        to a setpoint, which is solved for.
        """
        found = json.loads(self._core.tables)
        return {one["name"]: frame(one["columns"]) for one in found}

    def to_toml(self, *, dimensionless: bool = False) -> str:
        """The case file, which gives the same bytes of every result: a physical case with its units,
        its law and the distance at its setpoint, which is solved for. `dimensionless` writes the
        numbers of the equations in place of physical quantities.

        Raises:
            ValueError: a nonlinear law has no dimensionless case file.
            RuntimeError: the setpoint is not reached.
        """
        return self._core.toml(dimensionless)

    @property
    def inputs(self) -> dict[str, Any]:
        """What was stated, by table and key: `Case(**case.inputs)` is the same case."""
        stated: dict[str, Any] = json.loads(self._core.inputs)
        if self._core.model_units:
            stated["model_units"] = True
        return stated

    def explore(self, *, browser: bool = False) -> "Explorer":
        """Starts the explorer with this case. In a notebook on this machine the cell shows the page;
        `browser` opens it in a browser. `.case` of the result is the case as the page shows it now.

        >>> with Case.paper(omega=3).explore() as page:
        ...     page.case.omega
        3.0

        Raises:
            RuntimeError: the server did not start.
        """
        from ._explore import Explorer

        return Explorer(self, browser)

    def link(self, *, page: str | None = None) -> str:
        """A link that holds the case: the page that it leads to, which needs no server, opens it, and
        nothing is sent anywhere. `page` is the address of another copy of the page.

        >>> Case.paper().link(page="nanotap.html")[:18]
        'nanotap.html#case='

        Raises:
            RuntimeError: the setpoint is not reached.
        """
        return _nanotap.link(self.to_toml(), page)

    def to_dict(self) -> dict[str, Any]:
        """The whole document, as the terminal's `nanotap case --json`."""
        document: dict[str, Any] = json.loads(self._core.document_at_setpoint)
        return document

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError:
            message = f"the case has no `{name}`; it has {', '.join(self._document)}"
            raise AttributeError(message) from None

    def __setattr__(self, name: str, value: object) -> None:
        if name not in Case.__slots__:
            message = f"a case is immutable; case.with_({name}=…) creates a changed one"
            raise AttributeError(message)
        super().__setattr__(name, value)

    def __getitem__(self, name: str) -> Any:
        name = name if name in self._document else _OTHER_NAMES.get(name, name)
        if name in _WITHOUT_DISTANCE:
            return self._document[name]
        if name in self._document:
            return self._solved[name]
        tables = self._tables
        if name in tables:
            return Record(tables[name])
        found: Any = tables
        for part in name.split("."):
            if not isinstance(found, dict) or part not in found:
                raise KeyError(name)
            found = found[part]
        return found

    @property
    def _tables(self) -> dict[str, Any]:
        """What was stated of a physical case, by table and key."""
        stated = self.inputs if self.is_physical else {}
        return {
            name: table for name, table in stated.items() if isinstance(table, dict)
        }

    def _ipython_key_completions_(self) -> list[str]:
        tables = self._tables.items()
        named = [f"{table}.{key}" for table, keys in tables for key in keys]
        return [*self, *named, *self._own_parameters]

    @property
    def _own_parameters(self) -> list[str]:
        """The paths of the parameters of a formula."""
        own = self._tables.get("sample", {}).get("parameters", {})
        return [f"{_PARAMETERS}{key}" for key in own]

    def __iter__(self) -> Iterator[str]:
        return iter(self._document)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._document, *self._tables})

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Case):
            return NotImplemented
        same_units = self._core.model_units == other._core.model_units
        return same_units and self._core.document == other._core.document

    def __hash__(self) -> int:
        return hash(self._core.document)

    def __reduce__(self) -> tuple[Any, ...]:
        source, _, catalogues, folder = self._core.made_of
        flag = self._core.model_units
        return _again, (
            type(self),
            source,
            self._keys,
            catalogues,
            os.fspath(folder),
            flag,
        )

    def __repr__(self) -> str:
        if self.is_physical:
            return self._physical_repr()
        shown = ", ".join(
            f"{key}={value!r}"
            for key, value in self._document.items()
            if key not in {"kind", "period", "physical"} and value is not None
        )
        name = "Case" if self.kind == "cantilever" else f"Case[{self.kind}]"
        return f"{name}({shown})"

    def _physical_repr(self) -> str:
        """Lever, sample, drive and distance, as they were stated."""
        tables: dict[str, list[str]] = {}
        for key, value in json.loads(self._core.stated).items():
            if "." in key:
                table, name = key.split(".", 1)
                tables.setdefault(table, []).append(f"{name} = {value}")
        lines = [f"  {table}: {', '.join(tables[table])}" for table in tables]
        units = ", results in the model's units" if self._core.model_units else ""
        head = (
            f"Case: a cantilever with {self.modes} mode{'s' * (self.modes != 1)}{units}"
        )
        return "\n".join([head, *lines])

    def _repr_html_(self) -> str:
        symbols = {name: symbol for name, symbol, _ in self._core.parameters}
        rows = "".join(
            f"<tr><td>{escape(symbols.get(key, ''))}</td><td>{escape(key)}</td>"
            f"<td style='text-align:right'>{escape(_short(value))}</td></tr>"
            for key, value in self._document.items()
            if key not in {"kind", "physical"} and value is not None
        )
        numbers = f"<table><caption>{escape(self.kind)}</caption>{rows}</table>"
        # The numbers are those of the distance.
        return self._quantities_html() + (numbers if self._is_at_setpoint else "")

    def _quantities_html(self) -> str:
        """Lever, sample and drive of a physical case with their units."""
        stated = {
            key: value
            for key, value in json.loads(self._core.stated).items()
            if "." in key
        }
        rows = "".join(
            f"<tr><td>{escape(key)}</td>"
            f"<td style='text-align:right'>{escape(str(value))}</td></tr>"
            for key, value in stated.items()
        )
        return f"<table><caption>stated</caption>{rows}</table>" if rows else ""


def catalogue() -> "pd.DataFrame":
    """The built-in levers and materials, usable by name, with their sources.

    >>> catalogue().query("kind == 'lever'").name.head(3).tolist()
    ['AC160TS', 'AC200TS', 'AC240TS']
    """
    import pandas as pd

    return pd.DataFrame(_nanotap.catalogue(), columns=["kind", "name", "source"])


def _again(
    kind: type[Case],
    source: tuple[str, str] | None,
    words: dict[str, str],
    catalogues: list[tuple[str, str]],
    folder: str,
    model_units: bool,
) -> Case:
    case = kind.__new__(kind)
    case._make(source, words, catalogues, folder, model_units)
    return case


def _paths(given: Path | Iterable[Path]) -> list[Path]:
    return [given] if isinstance(given, str | os.PathLike) else list(given)


def missing(path: Path) -> FileNotFoundError:
    """The error of a file or folder that does not exist."""
    return FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), os.fspath(path))


def existing(path: Path) -> str:
    """The name of a file.

    Raises:
        FileNotFoundError: it does not exist.
    """
    if not os.path.exists(path):
        raise missing(path)
    return os.fspath(path)


def key_words(keys: Mapping[str, Any], kind: str = "cantilever") -> dict[str, str]:
    """`key=value` texts with the main name of each key, for a case of this `kind` unless the keys
    state another one.
    """
    table = keys.get("model")
    stated = table.get("kind") if isinstance(table, Mapping) else None
    kind = str(keys.get("kind") or keys.get("model.kind") or stated or kind)
    # The second names are those of a cantilever's numbers; the gap of an oscillator is another one.
    second_names = _OTHER_NAMES if kind == "cantilever" else {}
    words: dict[str, str] = {}
    typed: dict[str, str] = {}
    for key, value in keys.items():
        if key in _FOLLOWS:
            continue
        if isinstance(value, Mapping):
            for inner, quantity in value.items():
                name = f"{key}.{inner}"
                if f"{name}." == _PARAMETERS and isinstance(quantity, Mapping):
                    for own, number in quantity.items():
                        words[name + "." + own] = (
                            f"{name}.{own}={_written(f'{name}.{own}', number)}"
                        )
                else:
                    words[name] = f"{name}={_written(name, quantity)}"
        elif key == "sample_force":
            words["sample.law"] = "sample.law=formula"
            words["sample.force"] = f"sample.force={_written(key, value)}"
        else:
            name = key.removeprefix("model.")
            name = second_names.get(name, name)
            if name in typed:
                message = (
                    f"`{typed[name]}` and `{key}` are the same key; keep one of the two"
                )
                raise ValueError(message)
            typed[name] = key
            words[name] = f"{name}={_written(name, value)}"
    return words


#: What precedes the name of a formula's parameter.
_PARAMETERS = "sample.parameters."

#: Keys that take rows, as lists or as columns.
TABLES = {
    "sample.table",
    "sample.arms",
    "sample.prony",
    "sample.relaxation_arms",
    "relaxation_arms",
    "cantilever.mode",
    "lever_modes",
}


def _written(name: str, value: Any) -> str:
    if value is None:
        # The key is removed.
        return ""
    if name.startswith("scan."):
        # Options of the study `scan`, as JSON.
        return json.dumps(value)
    value = written(value) if name.startswith(_PARAMETERS) else in_si(name, value)
    if isinstance(value, np.generic | np.ndarray) and np.ndim(value) == 0:
        value = value.item()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return json.dumps(text(name, value)) if si_unit(name) else repr(value)
    if name in TABLES and not isinstance(value, bool):
        if isinstance(value, list | tuple) and any(
            hasattr(row, "items") for row in value
        ):
            return _tables(name, value)
        return json.dumps(_rows(value))
    message = f"{name}: expected a number or a text, got {value!r}"
    raise TypeError(message)


#: Units of the numbers of a mode that are given in SI.
_OF_MODES = {"f": "Hz", "frequency": "Hz", "k": "N/m", "stiffness": "N/m"}


def _tables(name: str, tables: Any) -> str:
    """A list of dictionaries as an array of tables; numbers of a physical case are in SI."""
    units = _OF_MODES if "." in name else {}

    def entry(key: str, value: Any) -> str:
        if isinstance(value, np.generic | np.ndarray) and np.ndim(value) == 0:
            value = value.item()
        if not isinstance(value, str | int | float) or isinstance(value, bool):
            written_value = written(value)
            if not isinstance(written_value, str):
                message = (
                    f"{name}: expected a number or a text for {key!r}, got {value!r}"
                )
                raise TypeError(message)
            value = written_value
        if key in units and not isinstance(value, str):
            value = f"{value!r} {units[key]}"
        return f"{json.dumps(key)} = {json.dumps(value, ensure_ascii=False)}"

    rows = (
        ", ".join(
            entry(str(key), value) for key, value in table.items() if value is not None
        )
        for table in tables
    )
    return "[" + ", ".join(f"{{{row}}}" for row in rows) + "]"


def _rows(table: Any) -> list[list[float | str]]:
    """The rows of a table, the names of its columns first."""
    if not hasattr(table, "items"):
        return [[_plain(entry) for entry in row] for row in table]
    columns = {str(name): np.asarray(column, float) for name, column in table.items()}
    rows = np.column_stack(list(columns.values())).tolist()
    return [list(columns), *rows]


def _plain(entry: Any) -> float | str:
    return entry if isinstance(entry, str) else float(entry)


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
