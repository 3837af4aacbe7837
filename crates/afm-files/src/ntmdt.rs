//! Curves of NT-MDT's Nova, exported as text: three columns with decimal commas and no header, height
//! in nm, deflection of approach and retract in nA of the detector.

use crate::distance::{Names, finish};
use crate::document::{Channel, Curve, Document, Segment, Style};
use crate::limits::Budget;
use crate::text::{any, number_with_comma};
use crate::text_table::{Layout, rows};
use crate::{Error, Format, Limits};

const NAMES: Names = Names {
    measured: &[],
    commanded: &["Height"],
    ramp: &[],
    deflection: &["DFL"],
    grows_toward_surface: false,
};

/// Whether a text begins with three numbers with decimal signs, between tabs.
pub(crate) fn begins(head: &[u8]) -> bool {
    let Some(line) = head.split(|of| *of == b'\n').next() else {
        return false;
    };
    let Ok(line) = std::str::from_utf8(line) else {
        return false;
    };
    let cells: Vec<&str> = line.trim_end().split('\t').collect();
    let is_number = |of: &&str| of.contains(',') && number_with_comma(of).is_some();
    cells.len() == 3 && cells.iter().all(is_number)
}

pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Document, Error> {
    let layout = Layout {
        format: Format::NtMdtText,
        separator: Some('\t'),
        columns: 3,
    };
    let text = any(bytes);
    let mut table = rows(text.lines(), 1, &layout, &mut Budget::new(limits))?;
    let mut document = Document::new(Format::NtMdtText, limits);
    document.notes.append(&mut table.notes);
    let points = table.columns.iter().map(Vec::len).min().unwrap_or(0);
    let segment = |style: Style, column: usize| {
        // Rows go from the deepest point outwards; before the first change the deflection is padding.
        let deflection = &table.columns[column][..points];
        let changed = deflection.iter().position(|of| *of != deflection[0]);
        let first = changed.unwrap_or(0).saturating_sub(1);
        let in_time = |values: &[f64]| -> Vec<f64> {
            match style {
                Style::Approach => values.iter().rev().copied().collect(),
                _ => values.to_vec(),
            }
        };
        Segment {
            style,
            label: String::new(),
            duration: None,
            channels: vec![
                Channel::new("Height", "nm", in_time(&table.columns[0][first..points])),
                Channel::new("DFL", "nA", in_time(&deflection[first..])),
            ],
        }
    };
    let mut curve = Curve::empty(0);
    curve.segments = vec![segment(Style::Approach, 1), segment(Style::Retract, 2)];
    finish(&mut curve, &NAMES);
    document.curves = Box::new(vec![curve]);
    Ok(document)
}
