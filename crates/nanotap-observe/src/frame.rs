//! Tables of a report, whose columns are declared once.
//!
//! A column has a name (JSON, CSV, datasets, Python), the head of tables that are read, the label of
//! an axis, a dimension and a form. From these follow the CSV file, the tables of the terminal and of
//! the page, the units and labels in the JSON schema, and the axes of figures. `rows!` declares the
//! columns with the fields of a struct; [`Rows`] adds what no field stores.

use std::borrow::Cow;
use std::rc::Rc;

use crate::table::shown_phase;
use crate::{Dimension, ObservableSet, Observables};
use nanotap_case::physical::quantity::JOULES_PER_ELECTRONVOLT;
use nanotap_case::quantity::{Kind, format_electronvolts, prefix_of};
use nanotap_case::units::Units;
use nanotap_quantity::number::{shortest, significant};

/// A cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// There is no value.
    Empty,
    /// A word, such as a direction.
    Word(String),
    /// A whole number.
    Count(usize),
    /// A number in the unit of its column.
    Number(f64),
}

/// A type whose values are cells.
pub trait AsCell {
    /// The value as a cell.
    fn cell(&self) -> Cell;
}

impl AsCell for Cell {
    fn cell(&self) -> Cell {
        self.clone()
    }
}

impl AsCell for f64 {
    fn cell(&self) -> Cell {
        Cell::Number(*self)
    }
}

impl AsCell for usize {
    fn cell(&self) -> Cell {
        Cell::Count(*self)
    }
}

impl AsCell for bool {
    fn cell(&self) -> Cell {
        Cell::Count(usize::from(*self))
    }
}

impl AsCell for str {
    fn cell(&self) -> Cell {
        Cell::Word(self.to_owned())
    }
}

impl AsCell for String {
    fn cell(&self) -> Cell {
        self.as_str().cell()
    }
}

impl<T: AsCell + ?Sized> AsCell for &T {
    fn cell(&self) -> Cell {
        T::cell(self)
    }
}

impl<T: AsCell> AsCell for Option<T> {
    fn cell(&self) -> Cell {
        self.as_ref().map_or(Cell::Empty, T::cell)
    }
}

/// The number, unless it is NaN or infinite.
pub fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// How the numbers of a column are shown to a reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// As short as possible: for words and whole numbers.
    Plain,
    /// With so many significant digits.
    Digits(usize),
    /// With so many decimals.
    Decimals(usize),
    /// A fraction in percent, with so many significant digits.
    Percent(usize),
    /// In SI each number with its own prefix and the second count of digits, in the model's units with
    /// the first; energies in eV.
    Quantity([usize; 2]),
    /// In SI each number with its own prefix and so many digits, energies in J.
    Prefixed(usize),
    /// In a power of ten of the SI unit for the whole column, and the digits.
    Scaled(i32, usize),
}

impl Form {
    /// A number of this dimension in the model's units, as text in `units`.
    pub fn shown(self, dimension: Dimension, units: Units, value: f64) -> String {
        match units {
            Units::Model => self.text(dimension, false, value),
            Units::Si(scales) => self.text(
                dimension,
                true,
                dimension.si(&scales).unwrap_or(f64::NAN) * value,
            ),
        }
    }

    /// A number of this dimension as text, in SI or in the model's own units.
    fn text(self, dimension: Dimension, si: bool, value: f64) -> String {
        let kind = dimension.kind().filter(|_| si);
        let is_angle = dimension == Dimension::Angle && !matches!(self, Self::Decimals(_));
        let value = if is_angle { shown_phase(value) } else { value };
        match (self, kind) {
            (Self::Plain, _) => shortest(value),
            (Self::Decimals(decimals), _) => format!("{value:.decimals$}"),
            (Self::Percent(digits), _) => significant(100.0 * value, digits),
            (Self::Scaled(power, digits), _) => significant(10f64.powi(-power) * value, digits),
            (Self::Quantity(_), Some(Kind::Energy)) => format_electronvolts(value),
            (Self::Quantity([_, digits]) | Self::Prefixed(digits), Some(kind)) => {
                kind.format_digits(value, digits)
            }
            (Self::Quantity([digits, _]) | Self::Prefixed(digits) | Self::Digits(digits), _) => {
                significant(value, digits)
            }
        }
    }
}

impl From<Form> for (Dimension, Form) {
    /// Of words, counts and pure numbers.
    fn from(form: Form) -> Self {
        (Dimension::Number, form)
    }
}

/// Alignment of the cells of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// To the left, for words.
    Left,
    /// To the right, for whole numbers.
    Right,
    /// At the decimal point, for other numbers.
    Point,
}

/// A column that is declared with a field of a struct.
#[derive(Debug)]
pub struct Declared<R: 'static> {
    /// Name in CSV headers, datasets and Python.
    pub name: &'static str,
    /// Head in tables that are read.
    pub head: &'static str,
    /// Label of an axis: a description, with the symbol between `$`.
    pub label: &'static str,
    /// Dimension, from which the units follow.
    pub dimension: Dimension,
    /// How it is shown.
    pub form: Form,
    /// Returns the cell of a row.
    pub of: fn(&R) -> Cell,
}

impl<R> Declared<R> {
    /// The number of a row, if it has one.
    pub fn number(&self, row: &R) -> Option<f64> {
        match (self.of)(row) {
            Cell::Number(number) => Some(number),
            _ => None,
        }
    }
}

/// A struct whose fields are declared as columns by `rows!`.
pub trait Row: Sized + 'static {
    /// The columns, in the order of the fields.
    const COLUMNS: &'static [Declared<Self>];
}

/// Declares a struct with its columns: `field: type = Dimension, "label", "head", Form` is a column, a
/// field without these is none. Without a head it is the label; without a form it has five digits.
/// The unit (`in model_unit` or `in si_unit`) and the label go into the JSON schema.
#[macro_export]
macro_rules! rows {
    (
        in $units:ident
        $(#[$about:meta])*
        pub struct $name:ident {
            $($(#[$of_field:meta])* pub $field:ident: $type:ty
                $(= $dimension:expr, $label:literal $(, $head:literal, $form:expr)?)?,)*
        }
    ) => {
        $(#[$about])*
        pub struct $name {
            $(
                $(#[$of_field])*
                $(#[schemars(extend(
                    "x-unit" = $crate::Dimension::$units({
                        use $crate::frame::prelude::*;
                        $dimension
                    }),
                    "x-label" = $label
                ))])?
                pub $field: $type,
            )*
        }

        impl $crate::frame::Row for $name {
            const COLUMNS: &'static [$crate::frame::Declared<Self>] = &[$($(
                $crate::frame::Declared {
                    name: stringify!($field),
                    head: $crate::rows!(@head $label $(, $head)?),
                    label: $label,
                    dimension: { use $crate::frame::prelude::*; $dimension },
                    form: $crate::rows!(@form $($form)?),
                    of: |row| $crate::frame::AsCell::cell(&row.$field),
                },
            )?)*];
        }
    };
    (@head $label:literal) => { $label };
    (@head $label:literal, $head:literal) => { $head };
    (@form) => { $crate::frame::Form::Digits(5) };
    (@form $form:expr) => { { use $crate::frame::prelude::*; $form } };
}
pub use rows;

/// Adds columns to [`Rows`], a line each: `"name", "head", shown => cell;` or `.method(…);`, with
/// [`Form`], [`Dimension`] and [`Align`] in scope.
#[macro_export]
macro_rules! columns {
    (@ $rows:expr;) => { $rows };
    (@ $rows:expr; .$method:ident($($argument:tt)*); $($more:tt)*) => {
        $crate::columns!(@ $rows.$method($($argument)*); $($more)*)
    };
    (@ $rows:expr; $name:expr, $head:expr, $shown:expr => $cell:expr; $($more:tt)*) => {
        $crate::columns!(@ $rows.column($name, $head, $shown, $cell); $($more)*)
    };
    ($rows:expr; $($columns:tt)*) => {{
        use $crate::frame::prelude::*;
        $crate::columns!(@ $rows; $($columns)*)
    }};
}
pub use columns;

/// As [`columns!`], to the finished [`Frame`].
#[macro_export]
macro_rules! frame {
    ($($columns:tt)*) => { $crate::columns! { $($columns)* .frame(); } };
}
pub use frame;

/// What declarations of columns name.
pub mod prelude {
    #![allow(unused_imports, reason = "each declaration needs some of them")]
    pub use super::Align::*;
    pub use super::Form::*;
    pub use crate::Dimension::{self, *};
    pub use nanotap_case::quantity::Kind;
}

/// Conversion from SI to a unit of files, and the name of this unit.
pub type FileUnit = (fn(f64) -> f64, &'static str);

/// A column of a frame.
pub struct Column<'a> {
    /// Name in CSV headers of the model's units, datasets and Python; empty: only shown.
    pub name: Cow<'static, str>,
    /// Name among quantities in SI.
    pub si_name: Cow<'static, str>,
    /// Head in tables that are read.
    pub head: Cow<'static, str>,
    /// Label of an axis.
    pub label: Cow<'static, str>,
    /// Dimension, from which the units follow.
    pub dimension: Dimension,
    /// How it is shown.
    pub form: Form,
    /// Whether its numbers are in SI, whatever the units of the frame.
    in_si: bool,
    only_in_files: bool,
    align: Option<Align>,
    /// Conversion from SI to the unit of SI files.
    in_files: Option<FileUnit>,
    of: Box<dyn Fn(usize) -> Cell + 'a>,
}

impl<'a> Column<'a> {
    /// A column whose head is its label, too. (Not generic: a frame has dozens.)
    fn new(
        name: Cow<'static, str>,
        head: Cow<'static, str>,
        (dimension, form): (Dimension, Form),
        of: Box<dyn Fn(usize) -> Cell + 'a>,
    ) -> Self {
        Self {
            si_name: name.clone(),
            name,
            label: head.clone(),
            head,
            dimension,
            form,
            in_si: false,
            only_in_files: false,
            align: None,
            in_files: None,
            of,
        }
    }
}

/// A table of a report: named columns of one length.
pub struct Frame<'a> {
    /// Name of the table.
    pub name: &'static str,
    /// The columns, in the order of files.
    pub columns: Vec<Column<'a>>,
    /// Number of rows.
    pub rows: usize,
    /// Units in which the numbers are shown; None: they are in SI.
    units: Option<Units>,
    shown: Cow<'static, str>,
    align: [Align; 2],
    /// Whether readers see each column as a line, whose head is that of the column.
    is_turned: bool,
}

impl<'a> Frame<'a> {
    /// The heads, each with its meaning and the alignment below it, and the cells of these rows, as
    /// readers are shown them.
    pub fn shown(&self, rows: impl IntoIterator<Item = usize>) -> TableText {
        let rows: Vec<usize> = rows.into_iter().collect();
        let columns = self.shown_columns();
        let texts = |c: &Column<'_>| rows.iter().map(|row| self.text(c, *row)).collect();
        match &columns[..] {
            [names, values @ ..] if self.is_turned => {
                let names: Vec<String> = texts(names);
                let heads = std::iter::once(self.head(columns[0])).chain(names);
                let line = |c: &&Column<'_>| {
                    let cells: Vec<String> = texts(c);
                    std::iter::once(self.head(c)).chain(cells).collect()
                };
                TableText {
                    heads: heads
                        .map(|head| (head, String::new(), Align::Left))
                        .collect(),
                    rows: values.iter().map(line).collect(),
                }
            }
            _ => TableText {
                heads: (columns.iter())
                    .map(|c| (self.head(c), c.label.to_string(), self.align(c)))
                    .collect(),
                rows: (rows.iter())
                    .map(|row| columns.iter().map(|c| self.text(c, *row)).collect())
                    .collect(),
            },
        }
    }

    /// The columns that readers are shown.
    pub fn shown_columns(&self) -> Vec<&Column<'a>> {
        if self.shown.is_empty() {
            return self.columns.iter().filter(|c| !c.only_in_files).collect();
        }
        let named = |name: &str| {
            let is_it = |c: &&Column<'a>| c.name == name || c.head == name;
            self.columns.iter().find(is_it)
        };
        self.shown.split(',').filter_map(named).collect()
    }

    /// The cell of a column, in the unit of [`Frame::unit`].
    pub fn cell(&self, column: &Column<'_>, row: usize) -> Cell {
        match ((column.of)(row), self.units) {
            (Cell::Number(value), Some(Units::Si(scales))) if !column.in_si => {
                Cell::Number(column.dimension.si(&scales).unwrap_or(f64::NAN) * value)
            }
            (cell, _) => cell,
        }
    }

    /// A cell as text for a reader.
    pub fn text(&self, column: &Column<'_>, row: usize) -> String {
        match self.cell(column, row) {
            Cell::Empty => String::new(),
            Cell::Word(word) => word,
            Cell::Count(count) => count.to_string(),
            Cell::Number(value) => column.form.text(column.dimension, self.is_si(), value),
        }
    }

    /// Alignment of a column.
    pub fn align(&self, column: &Column<'_>) -> Align {
        let is_word = |row| matches!((column.of)(row), Cell::Word(_));
        if let Some(align) = column.align {
            return align;
        }
        match column.form {
            Form::Plain if (0..self.rows).any(is_word) => Align::Left,
            Form::Plain => Align::Right,
            Form::Quantity(_) | Form::Prefixed(_) => self.align[0],
            _ => self.align[1],
        }
    }

    /// Whether numbers are in SI.
    pub fn is_si(&self) -> bool {
        !matches!(self.units, Some(Units::Model))
    }

    /// Unit of a column in files; empty in the model's units and of a pure number.
    pub fn unit(&self, dimension: Dimension) -> &'static str {
        if self.is_si() {
            dimension.file_unit()
        } else {
            ""
        }
    }

    /// Unit of the numbers of a column, as JSON schemas declare it; empty of a pure number.
    pub fn declared_unit(&self, dimension: Dimension) -> &'static str {
        let unit = if self.is_si() {
            dimension.si_unit()
        } else {
            dimension.model_unit()
        };
        if unit == "1" { "" } else { unit }
    }

    /// The name of a column, among quantities in SI or in the model's units.
    pub fn name<'c>(&self, column: &'c Column<'_>) -> &'c str {
        if self.is_si() {
            &column.si_name
        } else {
            &column.name
        }
    }

    /// The head of a column in tables that are read, with its unit where cells have none.
    pub fn head(&self, column: &Column<'_>) -> String {
        let head = &column.head;
        match (column.form, column.dimension) {
            (Form::Percent(_), _) => format!("{head} (%)"),
            (Form::Scaled(power, _), dimension) => {
                let prefix = prefix_of(power).unwrap_or_default();
                format!("{head} ({prefix}{})", self.unit(dimension))
            }
            (Form::Digits(_), Dimension::Angle) => format!("{head} (°)"),
            _ => head.to_string(),
        }
    }

    /// The table as CSV: every named column, in SI with the units in the heads.
    pub fn csv(&self) -> String {
        let columns = self.columns.iter().filter(|c| !c.name.is_empty());
        let head =
            |c: &Column<'_>| match c.in_files.map_or(self.unit(c.dimension), |(_, unit)| unit) {
                unit if !self.is_si() || unit.is_empty() => self.name(c).to_owned(),
                unit => format!("{} ({unit})", self.name(c)),
            };
        let mut csv = columns.clone().map(head).collect::<Vec<_>>().join(",") + "\n";
        for row in 0..self.rows {
            let cell = |c: &Column<'_>| match (self.cell(c, row), c.in_files) {
                (Cell::Empty, _) => String::new(),
                (Cell::Word(word), _) => word,
                (Cell::Count(count), _) => count.to_string(),
                (Cell::Number(value), Some((convert, _))) if self.is_si() => {
                    shortest(convert(value))
                }
                (Cell::Number(value), _) => shortest(value),
            };
            csv += &(columns.clone().map(cell).collect::<Vec<_>>().join(",") + "\n");
        }
        csv
    }
}

/// A frame as readers are shown it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TableText {
    /// Heads, with their meanings and the alignment below them.
    pub heads: Vec<(String, String, Align)>,
    /// The cells of each line.
    pub rows: Vec<Vec<String>>,
}

/// A frame that is being made from rows of one type.
pub struct Rows<'a, R> {
    rows: Rc<[R]>,
    frame: Frame<'a>,
}

impl<'a, R: Clone + 'a> Rows<'a, R> {
    /// Creates a frame of rows in the model's units, shown in `units`; without these the rows are in
    /// SI.
    pub fn new(
        name: &'static str,
        rows: impl IntoIterator<Item = R>,
        units: Option<Units>,
    ) -> Self {
        let rows: Rc<[R]> = rows.into_iter().collect();
        let frame = Frame {
            name,
            columns: Vec::new(),
            rows: rows.len(),
            units,
            shown: "".into(),
            align: [Align::Right, Align::Point],
            is_turned: false,
        };
        Self { rows, frame }
    }

    /// Adds a column.
    #[must_use]
    pub fn column<C: AsCell>(
        mut self,
        name: impl Into<Cow<'static, str>>,
        head: impl Into<Cow<'static, str>>,
        shown: impl Into<(Dimension, Form)>,
        of: impl Fn(R) -> C + 'a,
    ) -> Self {
        let rows = Rc::clone(&self.rows);
        let of = Box::new(move |row: usize| of(rows[row].clone()).cell());
        let column = Column::new(name.into(), head.into(), shown.into(), of);
        self.frame.columns.push(column);
        self
    }

    /// Adds the columns that are declared with the fields of a part of each row.
    #[must_use]
    pub fn fields<F: Row>(mut self, of: impl Fn(R) -> Option<&'a F> + Copy + 'a) -> Self {
        for c in F::COLUMNS {
            let cell = move |row| of(row).map_or(Cell::Empty, c.of);
            self = self
                .column(c.name, c.head, (c.dimension, c.form), cell)
                .label(c.label);
        }
        self
    }

    /// Adds the single numbers of a set of observables; in SI files energies in eV, too.
    #[must_use]
    pub fn observed(
        mut self,
        set: ObservableSet,
        of: impl Fn(R) -> Option<&'a Observables> + Copy + 'a,
    ) -> Self {
        for o in set.iter().filter(|o| o.is_number) {
            let form = match (o.head, o.dimension) {
                (Some(_), _) => Form::Percent(3),
                (None, Dimension::Angle | Dimension::Number) => Form::Digits(4),
                (None, Dimension::Energy) => Form::Quantity([4, 4]),
                _ => Form::Quantity([5, 4]),
            };
            let cell = move |row| of(row).and_then(|seen| (o.of)(seen).number());
            let head = o.head.unwrap_or(o.si_name);
            let add = |rows: Self| {
                let rows = rows.column(o.name, head, (o.dimension, form), cell);
                rows.label(o.label).si_name(o.si_name)
            };
            self = add(self);
            if o.dimension == Dimension::Energy && self.frame.is_si() {
                let ev: FileUnit = (|joules| joules / JOULES_PER_ELECTRONVOLT, "eV");
                self = add(self).in_files(ev).only_in_files();
            }
        }
        self
    }

    /// Shows readers the columns with these names or heads, separated by commas, in this order; without
    /// this, all that are not only in files.
    #[must_use]
    pub fn shown(mut self, names: impl Into<Cow<'static, str>>) -> Self {
        self.frame.shown = names.into();
        self
    }

    /// Aligns quantities, by default to the right, and other numbers, by default at the point.
    #[must_use]
    pub fn aligned(mut self, quantities: Align, numbers: Align) -> Self {
        self.frame.align = [quantities, numbers];
        self
    }

    /// Shows readers a line for each column but the first, which names what stands in the columns then:
    /// for few rows of many quantities.
    #[must_use]
    pub fn turned(mut self) -> Self {
        self.frame.is_turned = true;
        self
    }

    /// Aligns the columns of these names to the right.
    #[must_use]
    pub fn right(mut self, names: &[&str]) -> Self {
        let columns = self.frame.columns.iter_mut();
        for column in columns.filter(|column| names.contains(&&*column.name)) {
            column.align = Some(Align::Right);
        }
        self
    }

    /// Leaves the columns of these names out.
    #[must_use]
    pub fn without(mut self, names: &[&str]) -> Self {
        self.frame
            .columns
            .retain(|column| !names.contains(&&*column.name));
        self
    }

    /// Gives the last column another name among quantities in SI.
    #[must_use]
    pub fn si_name(mut self, name: &'static str) -> Self {
        self.last().si_name = name.into();
        self
    }

    /// Gives the last column the label of an axis.
    #[must_use]
    pub fn label(mut self, label: &'static str) -> Self {
        self.last().label = label.into();
        self
    }

    /// States that the numbers of the last column are in SI if the frame is.
    #[must_use]
    pub fn in_si(mut self) -> Self {
        self.last().in_si = true;
        self
    }

    /// Adds the columns that are declared with the fields of number `k` of several parts of each row,
    /// with names that end in `_1`, `_2`, … and heads that end in these numbers.
    #[must_use]
    pub fn fields_of<F: Row>(self, k: usize, of: impl Fn(R) -> Option<&'a F> + Copy + 'a) -> Self {
        let first = self.frame.columns.len();
        let mut all = self.fields(of);
        for column in &mut all.frame.columns[first..] {
            column.name = format!("{}_{}", column.name, k + 1).into();
            column.si_name = column.name.clone();
            column.head = format!("{} {}", column.head, k + 1).into();
        }
        all
    }

    /// Adds the entries of states, which stay in the model's units.
    #[must_use]
    pub fn states(mut self, names: Vec<String>, of: impl Fn(R) -> &'a [f64] + Copy + 'a) -> Self {
        for (k, name) in names.into_iter().enumerate() {
            let dimension = match self.frame.units.and_then(|units| units.of_entry(&name)) {
                Some((Kind::Length, _)) => Dimension::Unit("g0"),
                Some(_) => Dimension::Unit("g0/T"),
                None => Dimension::Number,
            };
            let entry = move |row| of(row).get(k).copied();
            self = self.column(name, "", (dimension, Form::Digits(5)), entry);
        }
        self
    }

    /// Leaves the last column out of tables that are read.
    #[must_use]
    pub fn only_in_files(mut self) -> Self {
        self.last().only_in_files = true;
        self
    }

    /// Aligns the last column.
    #[must_use]
    pub fn align(mut self, align: Align) -> Self {
        self.last().align = Some(align);
        self
    }

    /// Gives the last column another unit in SI files.
    #[must_use]
    pub fn in_files(mut self, unit: FileUnit) -> Self {
        self.last().in_files = Some(unit);
        self
    }

    /// The finished frame.
    pub fn frame(self) -> Frame<'a> {
        self.frame
    }

    /// The last column; every method that changes it follows one that adds it.
    fn last(&mut self) -> &mut Column<'a> {
        let last = self.frame.columns.len() - 1;
        &mut self.frame.columns[last]
    }
}
