//! What a dataset holds: its grid, its variables, its coordinates, its attributes.

use serde_json::{Map, Value};

use super::grid::Grid;

/// Attributes of a dataset or of a variable.
pub type Attributes = Map<String, Value>;

/// Numbers or words of one variable.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Real numbers; a missing one is NaN.
    Real(Vec<f64>),
    /// Whole numbers; the padding of a chunk is 0.
    Whole(Vec<i32>),
    /// Codes, as CF's `flag_values`; 0 is missing.
    Code(Vec<u8>),
    /// Words.
    Text(Vec<String>),
}

impl Values {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Real(v) => v.len(),
            Self::Whole(v) => v.len(),
            Self::Code(v) => v.len(),
            Self::Text(v) => v.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The values as numbers; none of words.
    pub fn numbers(self) -> Vec<f64> {
        match self {
            Self::Real(values) => values,
            Self::Whole(values) => values.into_iter().map(f64::from).collect(),
            Self::Code(values) => values.into_iter().map(f64::from).collect(),
            Self::Text(_) => Vec::new(),
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

/// What the entries of a variable are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `f64`.
    Real,
    /// `i32`.
    Whole,
    /// `u8`.
    Code,
    /// Words of at most so many characters.
    Text(usize),
}

impl Kind {
    /// Bytes an entry.
    pub fn size(self) -> usize {
        match self {
            Self::Real => 8,
            Self::Whole => 4,
            Self::Code => 1,
            Self::Text(length) => 4 * length,
        }
    }
}

/// A computed variable: over all axes of the grid, and then over further dimensions
/// that are not cut into chunks.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// What its entries are.
    pub kind: Kind,
    /// The further dimensions, name and length.
    pub tail: Vec<(String, usize)>,
    /// `long_name`, `units` and the like.
    pub attributes: Attributes,
}

impl Variable {
    /// A variable over the grid alone.
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

    /// With one more dimension.
    #[must_use]
    pub fn along(mut self, dimension: &str, length: usize) -> Self {
        self.tail.push((dimension.into(), length));
        self
    }

    /// With one more attribute.
    #[must_use]
    pub fn attribute(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.attributes.insert(key.into(), value.into());
        self
    }

    /// Entries for each entry of the grid.
    pub fn stride(&self) -> usize {
        self.tail.iter().map(|(_, length)| length).product()
    }
}

/// A coordinate: short, known from the start, written whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// Its name; with the name of a dimension it labels that dimension.
    pub name: String,
    /// Its dimensions.
    pub dimensions: Vec<String>,
    /// Its values, row-major.
    pub values: Values,
    /// `long_name`, `units` and the like.
    pub attributes: Attributes,
}

impl Coordinate {
    /// The labels of a dimension.
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

/// What a dataset holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Schema {
    /// The grid of chunks.
    pub grid: Grid,
    /// The computed variables. Their names are not those of coordinates.
    pub variables: Vec<Variable>,
    /// The coordinates.
    pub coordinates: Vec<Coordinate>,
    /// Everything that decides the numbers.
    pub attributes: Attributes,
}

impl Schema {
    /// The place of the variable called `name`.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.variables.iter().position(|v| v.name == name)
    }

    /// The values along an axis of the grid; where they are no numbers, these are counted.
    pub fn axis_values(&self, axis: usize) -> Vec<f64> {
        let axis = &self.grid.axes[axis];
        match self.coordinate(&axis.name).map(|c| &c.values) {
            Some(Values::Real(values)) => values.clone(),
            _ => (0..axis.length).map(|k| k as f64).collect(),
        }
    }

    /// The coordinate called `name`.
    pub fn coordinate(&self, name: &str) -> Option<&Coordinate> {
        self.coordinates.iter().find(|c| c.name == name)
    }
}
