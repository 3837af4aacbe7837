//! Thermal noise of JPK (`.tnd`): `# key: value` lines, then power spectral densities.

use crate::document::{Document, Spectrum};
use crate::limits::{Budget, MAX_CHANNELS, MAX_HEADER, at_most};
use crate::text::any;
use crate::text_table::{Layout, rows};
use crate::{Error, Format, Limits};

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    let text = any(bytes);
    let mut document = Document::new(Format::JpkThermal, limits);
    let is_header = |line: &str| line.starts_with('#') || line.trim().is_empty();
    let header: Vec<&str> = text.lines().take_while(|line| is_header(line)).collect();
    let length = header.iter().map(|of| of.len()).sum();
    at_most(length, MAX_HEADER, "bytes in a header")?;
    for line in &header {
        document.keep_setting(line.trim_start_matches('#'), ": ");
    }
    let quoted = |key: &str| -> Result<Vec<String>, Error> {
        let found = document.setting(key);
        let list =
            found.ok_or_else(|| Format::JpkThermal.at_key(key, "missing", "names in quotes"))?;
        Ok(list
            .split('\'')
            .skip(1)
            .step_by(2)
            .map(str::to_owned)
            .collect())
    };
    let (names, units) = (quoted("Channels")?, quoted("Units")?);
    at_most(names.len(), MAX_CHANNELS, "columns")?;
    if names.len() != units.len() || names.len() < 2 || units[0] != "Hz" {
        let problem = format!("{} names and {} units", names.len(), units.len());
        let expected = "the frequency in Hz and at least one density";
        return Err(Format::JpkThermal.at_key("Units", problem, expected));
    }
    let layout = Layout {
        format: Format::JpkThermal,
        separator: None,
        columns: names.len(),
    };
    let lines = text.lines().skip(header.len());
    let mut table = rows(lines, header.len() + 1, &layout, &mut Budget::new(limits))?;
    document.notes = table.notes;
    let frequency = table.columns.remove(0);
    for ((name, unit), values) in names.into_iter().zip(units).skip(1).zip(table.columns) {
        if values.len() == frequency.len() {
            document.spectra.push(Spectrum {
                name,
                unit,
                frequency: frequency.clone(),
                values,
            });
        }
    }
    Ok(document)
}
