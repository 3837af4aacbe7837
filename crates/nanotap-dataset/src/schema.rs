//! Content of a dataset: grid, variables, coordinates and attributes.

use serde_json::{Map, Value};

use super::grid::Grid;

/// Attributes of a dataset or of a variable.
pub type Attributes = Map<String, Value>;

/// Values of one variable or coordinate, all of one type.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Real numbers; missing values are NaN.
    Real(Vec<f64>),
    /// Integers; the padding of a chunk is 0.
    Whole(Vec<i32>),
    /// Codes for CF `flag_values`; 0 is missing.
    Code(Vec<u8>),
    /// Texts; missing values are empty.
    Text(Vec<String>),
}

impl Values {
    /// Returns the number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::Real(v) => v.len(),
            Self::Whole(v) => v.len(),
            Self::Code(v) => v.len(),
            Self::Text(v) => v.len(),
        }
    }

    /// True if there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Converts the values to numbers; texts give an empty vector.
    pub fn numbers(self) -> Vec<f64> {
        match self {
            Self::Real(values) => values,
            Self::Whole(values) => values.into_iter().map(f64::from).collect(),
            Self::Code(values) => values.into_iter().map(f64::from).collect(),
            Self::Text(_) => Vec::new(),
        }
    }

    /// Copies `count` values from place `start` of `from`, which has the same type, to place `at`.
    pub(super) fn copy_from(&mut self, at: usize, from: &Self, start: usize, count: usize) {
        let (to, from_range) = (at..at + count, start..start + count);
        match (self, from) {
            (Self::Real(own), Self::Real(v)) => own[to].copy_from_slice(&v[from_range]),
            (Self::Whole(own), Self::Whole(v)) => own[to].copy_from_slice(&v[from_range]),
            (Self::Code(own), Self::Code(v)) => own[to].copy_from_slice(&v[from_range]),
            (Self::Text(own), Self::Text(v)) => own[to].clone_from_slice(&v[from_range]),
            _ => {}
        }
    }

    pub(crate) fn kind(&self) -> Kind {
        match self {
            Self::Real(_) => Kind::Real,
            Self::Whole(_) => Kind::Whole,
            Self::Code(_) => Kind::Code,
            Self::Text(words) => Kind::Text(
                words
                    .iter()
                    .map(|w| w.chars().count())
                    .max()
                    .unwrap_or(0)
                    .max(1),
            ),
        }
    }
}

/// Type of the entries of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Real numbers, `f64`; missing values are NaN.
    Real,
    /// Integers, `i32`.
    Whole,
    /// Codes of categories, `u8`; 0 is missing.
    Code,
    /// Texts of at most this many characters.
    Text(usize),
}

impl Kind {
    /// Number of bytes per entry.
    pub fn size(self) -> usize {
        match self {
            Self::Real => 8,
            Self::Whole => 4,
            Self::Code => 1,
            Self::Text(length) => 4 * length,
        }
    }

    /// Creates `count` missing values of this type.
    pub(super) fn missing(self, count: usize) -> Values {
        match self {
            Self::Real => Values::Real(vec![f64::NAN; count]),
            Self::Whole => Values::Whole(vec![0; count]),
            Self::Code => Values::Code(vec![0; count]),
            Self::Text(_) => Values::Text(vec![String::new(); count]),
        }
    }
}

/// A computed variable over all axes of the grid, and over further dimensions that are not divided
/// into chunks.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name of the variable in the dataset.
    pub name: String,
    /// Type of the entries of the variable.
    pub kind: Kind,
    /// Further dimensions after the axes of the grid: name and length.
    pub tail: Vec<(String, usize)>,
    /// `long_name`, `units` and other attributes.
    pub attributes: Attributes,
}

impl Variable {
    /// Creates a variable over the grid alone.
    pub fn new(name: &str, kind: Kind, long_name: &str, units: &str) -> Self {
        let mut attributes = Attributes::new();
        attributes.insert("long_name".into(), long_name.into());
        attributes.insert("units".into(), units.into());
        Self {
            name: name.into(),
            kind,
            tail: Vec::new(),
            attributes,
        }
    }

    /// Adds a further dimension of this name and length.
    #[must_use]
    pub fn along(mut self, dimension: &str, length: usize) -> Self {
        self.tail.push((dimension.into(), length));
        self
    }

    /// Adds an attribute with this key, or replaces it.
    #[must_use]
    pub fn attribute(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.attributes.insert(key.into(), value.into());
        self
    }

    /// Number of entries for each entry of the grid.
    pub fn stride(&self) -> usize {
        self.tail.iter().map(|(_, length)| length).product()
    }
}

/// A coordinate: short, known in advance, stored in one piece.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// Name of the coordinate; if it is that of a dimension, the coordinate labels this dimension.
    pub name: String,
    /// Names of the dimensions of the coordinate.
    pub dimensions: Vec<String>,
    /// Values of the coordinate, row-major over its dimensions.
    pub values: Values,
    /// `long_name`, `units` and other attributes.
    pub attributes: Attributes,
}

impl Coordinate {
    /// Creates the labels of a dimension.
    pub fn of(dimension: &str, values: Values, long_name: &str, units: &str) -> Self {
        let mut attributes = Attributes::new();
        attributes.insert("long_name".into(), long_name.into());
        attributes.insert("units".into(), units.into());
        Self {
            name: dimension.into(),
            dimensions: vec![dimension.into()],
            values,
            attributes,
        }
    }
}

/// Content of a dataset: grid, variables, coordinates and attributes.
#[derive(Clone, Debug, PartialEq)]
pub struct Schema {
    /// Grid of chunks that all variables share.
    pub grid: Grid,
    /// The computed variables; their names differ from those of coordinates.
    pub variables: Vec<Variable>,
    /// Coordinates, which are known before the computation.
    pub coordinates: Vec<Coordinate>,
    /// Attributes of the dataset: everything that determines its numbers.
    pub attributes: Attributes,
}

impl Schema {
    /// Index of the variable called `name`.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.variables.iter().position(|v| v.name == name)
    }

    /// Bytes of the values of all variables; `None` if there are more than a machine can number.
    pub fn bytes(&self) -> Option<usize> {
        let lengths = self.grid.axes.iter().map(|axis| axis.length);
        let entry: usize = self
            .variables
            .iter()
            .map(|v| v.stride() * v.kind.size())
            .sum();
        lengths.into_iter().try_fold(entry, usize::checked_mul)
    }

    /// Values along an axis of the grid; for labels that are not numbers, their indices.
    pub fn axis_values(&self, axis: usize) -> Vec<f64> {
        let axis = &self.grid.axes[axis];
        match self.coordinate(&axis.name).map(|c| &c.values) {
            Some(Values::Real(values)) => values.clone(),
            _ => (0..axis.length).map(|k| k as f64).collect(),
        }
    }

    /// Returns the coordinate called `name`, if there is one.
    pub fn coordinate(&self, name: &str) -> Option<&Coordinate> {
        self.coordinates.iter().find(|c| c.name == name)
    }
}
