//! Modes of a lever as stated in a case: frequency, stiffness, quality factor and, if it is known,
//! participation in the motion of the base.
//!
//! In a case file each mode is a table:
//!
//! ```toml
//! [[cantilever.mode]]
//! f = "48.913 kHz"
//! k = "0.9 N/m"
//! Q = 255
//! ```
//!
//! The same modes are the array `mode = [{f = "48.913 kHz", k = "0.9 N/m", Q = 255}]`, rows under names
//! with units, `mode = [["f (kHz)", "k (N/m)", "Q"], [48.913, 0.9, 255]]`, or the name of a CSV file with
//! these columns. In `[model]`, `lever_modes` takes the same with plain numbers.

use std::sync::Arc;

use super::force_table::ForceTableError;
use super::near_name::near_name;
use super::quantity::Kind;
use super::table::{Entry, Header, Table};
use nanotap_model::beam::MAX_MODES;
use nanotap_model::lever_mode::LeverMode;

/// Syntax of the modes of a physical lever, for remedies.
pub(crate) const SHAPE: &str = "write each mode as in mode = [{f = \"75 kHz\", k = \"2.8 N/m\", Q = 200}], or as a table \
     [[cantilever.mode]] with f, k and Q";
/// Syntax of the modes of a dimensionless lever, for remedies.
pub(crate) const MODEL_SHAPE: &str =
    "write each mode as in lever_modes = [{frequency = 3.516, stiffness = 3.09, quality = 200}]";

/// A number of a mode: names of its column and the kind of quantity.
struct Column {
    names: &'static [&'static str],
    kind: Kind,
    /// Whether every mode needs it.
    required: bool,
}

/// Modes of a lever, each with its own frequency, by ascending frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct LeverModes {
    /// Modes in Hz and N/m, or in the units of the model.
    modes: Arc<[LeverMode]>,
    is_physical: bool,
}

impl LeverModes {
    /// The modes, in Hz and N/m, or in the units of the model.
    pub fn modes(&self) -> &[LeverMode] {
        &self.modes
    }

    /// The measured modes of a dimensionless case; `None` for a uniform beam.
    pub(crate) fn of_model(modes: &[LeverMode]) -> Option<Self> {
        (!modes.is_empty()).then(|| Self {
            modes: modes.into(),
            is_physical: false,
        })
    }

    /// Static spring constant of the lever at the tip, 1/Σ(1/k_j), in the unit of the stiffnesses.
    pub fn static_stiffness(&self) -> f64 {
        let give: f64 = self.modes.iter().map(|mode| 1.0 / mode.stiffness).sum();
        1.0 / give
    }

    /// Frequency, stiffness, quality factor and participation, in this order.
    fn columns(is_physical: bool) -> [Column; 4] {
        let number = |names: &'static [&'static str], kind, required| Column {
            names,
            kind: if is_physical { kind } else { Kind::Number },
            required,
        };
        [
            number(&["f", "frequency"], Kind::Frequency, true),
            number(&["k", "stiffness"], Kind::Stiffness, true),
            number(
                &["Q", "quality", "quality factor"],
                Kind::Number,
                is_physical,
            ),
            number(&["participation"], Kind::Number, false),
        ]
    }

    /// Reads the modes of a table with a row a mode.
    ///
    /// # Errors
    /// If a column or a value is missing, unknown or not allowed.
    pub(crate) fn of(table: &Table, is_physical: bool) -> Result<Self, ForceTableError> {
        let shape = if is_physical { SHAPE } else { MODEL_SHAPE };
        let refuse = |message: String| ForceTableError::new(message, shape);
        let columns = Self::columns(is_physical);
        let headers: Vec<Header> = table
            .columns
            .iter()
            .map(|(name, _)| Header::of(name))
            .collect();
        let is = |column: &Column, header: &Header| {
            let name = header.name.to_lowercase();
            column
                .names
                .iter()
                .any(|other| other.to_lowercase() == name)
        };
        for (header, (written, _)) in headers.iter().zip(&table.columns) {
            if !columns.iter().any(|column| is(column, header)) {
                let names = columns.iter().map(|column| {
                    column.names[usize::from(!is_physical).min(column.names.len() - 1)]
                });
                let meant = near_name(&header.name, names.clone());
                let hint = meant.map_or_else(
                    || format!("it has {}", names.collect::<Vec<_>>().join(", ")),
                    |meant| format!("did you mean `{meant}`?"),
                );
                return Err(refuse(format!(
                    "`{written}` is not a number of a mode; {hint}"
                )));
            }
        }
        let count = table
            .columns
            .first()
            .map_or(0, |(_, entries)| entries.len());
        if !(1..=MAX_MODES).contains(&count) {
            return Err(refuse(format!("{count} modes; expected 1 to {MAX_MODES}")));
        }
        let value = |column: &Column, row: usize| -> Result<Option<f64>, ForceTableError> {
            let name = column.names[0];
            let at = |what: String| refuse(format!("mode {}: {what}", row + 1));
            let mut found = (0..headers.len()).filter(|k| is(column, &headers[*k]));
            let (place, more) = (found.next(), found.next());
            if more.is_some() {
                return Err(at(format!("`{name}` is given twice")));
            }
            let entry = place.map_or(&Entry::Missing, |k| &table.columns[k].1[row]);
            let text = match entry {
                Entry::Missing if column.required => {
                    return Err(at(format!("`{name}` is missing")));
                }
                Entry::Missing => return Ok(None),
                Entry::Text(text) => text.clone(),
                Entry::Number(number) => {
                    let unit = place.map_or("", |k| headers[k].unit.as_ref());
                    format!("{number:?} {unit}").trim_end().to_owned()
                }
            };
            let read = column.kind.parse(&text);
            read.map(Some)
                .map_err(|error| at(format!("{name}: {error}")))
        };
        let [frequency, stiffness, quality, participation] = &columns;
        let mode = |row: usize| {
            let mode = LeverMode {
                frequency: value(frequency, row)?.unwrap_or_default(),
                stiffness: value(stiffness, row)?.unwrap_or_default(),
                quality: value(quality, row)?.unwrap_or_default(),
                participation: value(participation, row)?,
            };
            let positive = [mode.frequency, mode.stiffness];
            let has_quality = mode.quality > 0.0 || !is_physical && mode.quality == 0.0;
            let finite = positive
                .iter()
                .chain([&mode.quality])
                .chain(&mode.participation);
            let is_allowed = positive.iter().all(|value| *value > 0.0)
                && has_quality
                && finite.copied().all(f64::is_finite);
            if !is_allowed {
                return Err(refuse(format!(
                    "mode {}: frequency, stiffness and quality factor must be finite and above zero",
                    row + 1
                )));
            }
            Ok(mode)
        };
        let modes = (0..count).map(mode).collect::<Result<Vec<_>, _>>()?;
        if let Some(row) = modes
            .windows(2)
            .position(|pair| pair[1].frequency <= pair[0].frequency)
        {
            return Err(ForceTableError::new(
                format!(
                    "the frequency of mode {} is not above that of mode {}",
                    row + 2,
                    row + 1
                ),
                "give the modes in the order of their frequencies",
            ));
        }
        Ok(Self {
            modes: modes.into(),
            is_physical,
        })
    }

    /// The modes as the text of an array that parses to the same modes.
    pub fn text(&self) -> String {
        let columns = Self::columns(self.is_physical);
        let written = |column: &Column, value: f64| {
            let name = column.names[usize::from(!self.is_physical).min(column.names.len() - 1)];
            match column.kind {
                Kind::Number => format!("{name} = {value:?}"),
                kind => format!("{name} = \"{}\"", kind.format_exact(value)),
            }
        };
        let modes = self.modes.iter().map(|mode| {
            let quality = (mode.quality > 0.0).then_some(mode.quality);
            let numbers = [
                Some(mode.frequency),
                Some(mode.stiffness),
                quality,
                mode.participation,
            ];
            let stated = columns.iter().zip(numbers);
            let stated = stated.filter_map(|(column, value)| Some(written(column, value?)));
            format!("{{{}}}", stated.collect::<Vec<_>>().join(", "))
        });
        format!("[{}]", modes.collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Takes;
    use crate::stated::Value;

    fn read(text: &str) -> Result<LeverModes, String> {
        match Takes::LeverModes.parse_table(text) {
            Ok(Value::LeverModes(modes)) => Ok(modes),
            Ok(_) => unreachable!("a key of modes"),
            Err(error) => Err(error.message),
        }
    }

    #[test]
    fn modes_are_read_in_every_form_and_written_exactly() {
        let tables = read(
            "[{f = \"48.913 kHz\", k = \"0.9 N/m\", Q = 255}, \
             {f = \"306194 Hz\", k = \"35.2 N/m\", Q = 1002, participation = -0.8}]",
        )
        .unwrap();
        let rows = read(
            "[[\"f (kHz)\", \"k (N/m)\", \"Q\", \"participation\"], [48.913, 0.9, 255, \"\"], \
             [306.194, 35.2, 1002, -0.8]]",
        );
        assert_eq!(tables.modes()[1].participation, Some(-0.8));
        assert_eq!(tables.modes()[0].participation, None);
        assert_eq!(tables.modes()[0].frequency, 48913.0);
        assert_eq!(rows.as_ref(), Ok(&tables));
        assert_eq!(read(&tables.text()), Ok(tables.clone()));
        // 1/(1/0.9 + 1/35.2).
        assert!((tables.static_stiffness() - 0.9 * 35.2 / 36.1).abs() < 1e-15);
    }

    #[test]
    fn what_is_not_a_mode_is_refused() {
        for (text, message) in [
            ("[{f = \"1 kHz\", k = \"1 N/m\"}]", "`Q` is missing"),
            ("[{f = \"1 kHz\", k = \"-1 N/m\", Q = 3}]", "above zero"),
            ("[{f = \"1 kHz\", k = \"1 N/m\", Q = 0}]", "above zero"),
            (
                "[{f = \"1 kHz\", k = \"1 N/m\", Q = 3, particpation = 1}]",
                "did you mean `participation`",
            ),
            (
                "[{f = \"2 kHz\", k = \"1 N/m\", Q = 3}, {f = \"1 kHz\", k = \"1 N/m\", Q = 3}]",
                "mode 2 is not above that of mode 1",
            ),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(message), "{text}: {error}");
        }
        let many = vec!["{f = \"1 kHz\", k = \"1 N/m\", Q = 3}"; 51].join(", ");
        assert!(read(&format!("[{many}]")).unwrap_err().contains("1 to 50"));
    }
}
