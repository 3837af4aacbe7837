//! Maps as Gwyddion Simple Field files (`.gsf`), which programs for AFM data can open.
//!
//! A file is a text header, zeros up to the next multiple of four bytes, and the values as
//! little-endian 32-bit floats, row by row from the top. Since images have their origin at the top,
//! the row of the largest `y` comes first. Unknown values are NaN.

use std::fmt::Write as _;

/// Two axes and a value at each grid point.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Title of the map, on one line.
    pub title: String,
    /// Values of the horizontal axis in `axis_unit`, equidistant and ascending.
    pub x: Vec<f64>,
    /// Values of the vertical axis in `axis_unit`, equidistant and ascending.
    pub y: Vec<f64>,
    /// Values in `value_unit`, one row per value of `y`; unknown ones are NaN.
    pub values: Vec<f64>,
    /// Unit of the axes in SI, empty if they have none.
    pub axis_unit: String,
    /// Unit of the values in SI, empty if they have none.
    pub value_unit: String,
}

/// Why a field cannot be written as GSF.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// The values do not fill the axes.
    #[error("got {found} values, expected {columns} × {rows}")]
    Size {
        /// Number of values in the field.
        found: usize,
        /// Length of the horizontal axis.
        columns: usize,
        /// Length of the vertical axis.
        rows: usize,
    },
    /// The values of an axis are not equidistant and ascending.
    #[error(
        "a GSF file needs equal steps, but the values of the {axis} axis are not ascending and equidistant"
    )]
    Steps {
        /// Name of the axis: `horizontal` or `vertical`.
        axis: &'static str,
    },
    /// An axis has no values.
    #[error("the {axis} axis is empty")]
    Empty {
        /// Name of the axis: `horizontal` or `vertical`.
        axis: &'static str,
    },
}

/// Largest deviation of an axis value from an equidistant one, as a fraction of the step.
const TOLERANCE: f64 = 1e-6;
/// Alignment of the end of the header, in bytes.
const ALIGNMENT: usize = 4;

impl Field {
    /// Encodes the field as a GSF file.
    ///
    /// # Errors
    /// [`FieldError`] if the format cannot represent it.
    pub fn to_gsf(&self) -> Result<Vec<u8>, FieldError> {
        let (columns, rows) = (self.x.len(), self.y.len());
        let (across, up) = (step(&self.x, "horizontal")?, step(&self.y, "vertical")?);
        // The pixels of a single line or column are squares.
        let (across, up) = (across.or(up).unwrap_or(1.0), up.or(across).unwrap_or(1.0));
        let (width, height) = (across * columns as f64, up * rows as f64);
        let (left, bottom) = (self.x[0] - 0.5 * across, self.y[0] - 0.5 * up);
        if columns.checked_mul(rows) != Some(self.values.len()) {
            return Err(FieldError::Size {
                found: self.values.len(),
                columns,
                rows,
            });
        }
        let mut header = String::from("Gwyddion Simple Field 1.0\n");
        // Writing to a string cannot fail.
        let _ = write!(
            header,
            "XRes = {columns}\nYRes = {rows}\nXReal = {width:e}\nYReal = {height:e}\n\
             XOffset = {left:e}\nYOffset = {bottom:e}\n"
        );
        for (key, text) in [
            ("Title", &self.title),
            ("XYUnits", &self.axis_unit),
            ("ZUnits", &self.value_unit),
        ] {
            let line: String = text.chars().filter(|c| !c.is_control()).collect();
            if !line.is_empty() {
                let _ = writeln!(header, "{key} = {line}");
            }
        }
        let mut file = header.into_bytes();
        // The header ends with at least one zero.
        let zeros = ALIGNMENT - file.len() % ALIGNMENT;
        file.resize(file.len() + zeros, 0);
        for row in self.values.chunks_exact(columns).rev() {
            file.extend(row.iter().flat_map(|value| (*value as f32).to_le_bytes()));
        }
        Ok(file)
    }
}

/// Step between the values of an axis; `None` of a single one.
fn step(values: &[f64], axis: &'static str) -> Result<Option<f64>, FieldError> {
    let (Some(first), Some(last)) = (values.first(), values.last()) else {
        return Err(FieldError::Empty { axis });
    };
    if values.len() == 1 && first.is_finite() {
        return Ok(None);
    }
    let step = (last - first) / (values.len() - 1) as f64;
    let in_place =
        |(k, value): (usize, &f64)| (value - (first + step * k as f64)).abs() <= TOLERANCE * step;
    // The comparison is false for a step that is NaN.
    if step > 0.0 && step.is_finite() && values.iter().enumerate().all(in_place) {
        Ok(Some(step))
    } else {
        Err(FieldError::Steps { axis })
    }
}

impl From<FieldError> for nanotap_error::Error {
    fn from(error: FieldError) -> Self {
        Self::new(nanotap_error::ErrorKind::BadInput, error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field() -> Field {
        Field {
            title: "a map".into(),
            x: vec![1.0, 2.0, 3.0],
            y: vec![10.0, 20.0],
            values: vec![1.0, 2.0, 3.0, 4.0, 5.0, f64::NAN],
            axis_unit: String::new(),
            value_unit: "m".into(),
        }
    }

    /// The layout is that of Gwyddion's user guide, "Gwyddion Simple Field".
    #[test]
    fn a_field_is_header_zeros_and_rows_from_the_top() {
        let file = field().to_gsf().unwrap();
        let end = file.iter().position(|byte| *byte == 0).unwrap();
        let header = std::str::from_utf8(&file[..end]).unwrap();
        assert_eq!(
            header,
            "Gwyddion Simple Field 1.0\nXRes = 3\nYRes = 2\nXReal = 3e0\nYReal = 2e1\n\
             XOffset = 5e-1\nYOffset = 5e0\nTitle = a map\nZUnits = m\n"
        );
        let data = &file[file.len() - 4 * 6..];
        assert_eq!((file.len() - data.len()) % 4, 0);
        let zeros = &file[end..file.len() - data.len()];
        assert!((1..=4).contains(&zeros.len()) && zeros.iter().all(|byte| *byte == 0));
        let values: Vec<f32> = data
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
            .collect();
        assert_eq!(values[..2], [4.0, 5.0]);
        assert!(values[2].is_nan());
        assert_eq!(values[3..], [1.0, 2.0, 3.0]);
    }

    #[test]
    fn a_single_line_has_square_pixels() {
        let line = Field {
            x: vec![1e-9, 3e-9, 5e-9],
            y: vec![0.0],
            values: vec![1.0, 2.0, 3.0],
            ..field()
        };
        let file = line.to_gsf().unwrap();
        let end = file.iter().position(|byte| *byte == 0).unwrap();
        let header = std::str::from_utf8(&file[..end]).unwrap();
        let value = |key: &str| -> f64 {
            let line = header.lines().find(|line| line.starts_with(key)).unwrap();
            line.rsplit(' ').next().unwrap().parse().unwrap()
        };
        assert!((value("XReal") - 6e-9).abs() < 1e-20);
        assert!((value("YReal") - 2e-9).abs() < 1e-20);
        assert!((value("YOffset") + 1e-9).abs() < 1e-20);
    }

    #[test]
    fn the_header_is_padded_whatever_its_length() {
        for length in 0..9 {
            let field = Field {
                title: "t".repeat(length),
                ..field()
            };
            let file = field.to_gsf().unwrap();
            assert_eq!(file.len() % 4, 0);
            assert_eq!(file[file.len() - 24 - 1], 0);
        }
    }

    #[test]
    fn what_is_no_row_of_pixels_is_refused() {
        for x in [
            vec![1.0, 2.0, 4.0],
            vec![3.0, 2.0, 1.0],
            vec![1.0, 1.0, 1.0],
            vec![1.0, f64::NAN, 3.0],
            vec![f64::INFINITY, 2.0, 3.0],
        ] {
            let refused = Field { x, ..field() }.to_gsf();
            assert_eq!(refused, Err(FieldError::Steps { axis: "horizontal" }));
        }
        let empty = Field {
            y: Vec::new(),
            ..field()
        };
        assert_eq!(empty.to_gsf(), Err(FieldError::Empty { axis: "vertical" }));
        let short = Field {
            values: vec![1.0],
            ..field()
        };
        assert!(matches!(short.to_gsf(), Err(FieldError::Size { .. })));
    }
}
