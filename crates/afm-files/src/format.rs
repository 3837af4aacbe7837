//! Recognition of files by their content.

use std::fmt;

use serde::Serialize;

use crate::text::latin1;
use crate::zip::Directory;
use crate::{igor, jpk, ntmdt};

/// Formats that are recognised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Format {
    /// JPK/Bruker force curves: `.jpk-force`, `.jpk-force-map`, `.jpk-qi-data`, `.jpk-qi-series`.
    Jpk,
    /// JPK images: `.jpk`, `.jpk-qi-image`.
    JpkImage,
    /// JPK thermal noise: `.tnd`.
    JpkThermal,
    /// Bruker Nanoscope: `.spm`, `.000` to `.999`, `.pfc`.
    Nanoscope,
    /// Nanosurf: `.nid`.
    Nanosurf,
    /// Igor binary wave of Asylum Research: `.ibw`.
    Igor,
    /// Igor experiment: `.pxp`, `.pxt`.
    IgorExperiment,
    /// Asylum Research: `.ardf`.
    Ardf,
    /// Gwyddion: `.gwy`.
    Gwyddion,
    /// Gwyddion Simple Field: `.gsf`.
    Gsf,
    /// AFM Workshop: `.csv`.
    Workshop,
    /// NT-MDT Nova: curves exported as text.
    NtMdtText,
    /// Optics11 Chiaro: indentations as text.
    Chiaro,
    /// Universal force format, a text.
    Uff,
    /// WSxM images: `.stp`, `.top`.
    Wsxm,
    /// High-speed AFM video: `.asd`.
    Asd,
    /// HDF5.
    Hdf5,
    /// A zip archive of other files.
    Zip,
}

impl fmt::Display for Format {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Jpk => "JPK curves",
            Self::JpkImage => "JPK image",
            Self::JpkThermal => "JPK thermal noise",
            Self::Nanoscope => "Bruker Nanoscope",
            Self::Nanosurf => "Nanosurf .nid",
            Self::Igor => "Igor binary wave",
            Self::IgorExperiment => "Igor experiment",
            Self::Ardf => "Asylum .ardf",
            Self::Gwyddion => "Gwyddion .gwy",
            Self::Gsf => "Gwyddion simple field",
            Self::Workshop => "AFM Workshop text",
            Self::NtMdtText => "NT-MDT text",
            Self::Chiaro => "Optics11 Chiaro text",
            Self::Uff => "universal force format",
            Self::Wsxm => "WSxM image",
            Self::Asd => "high-speed AFM video",
            Self::Hdf5 => "HDF5",
            Self::Zip => "zip archive",
        })
    }
}

/// Bytes that tell the format.
pub(crate) const BEGINNING: usize = 4096;

/// First bytes of text formats and others with a fixed beginning.
const BEGINNINGS: [(&[u8], Format); 15] = [
    (b"PK\x03\x04", Format::Zip),
    (b"\\*Force file list", Format::Nanoscope),
    (b"\\*File list", Format::Nanoscope),
    (b"?*Force file list", Format::Nanoscope),
    (b"?*File list", Format::Nanoscope),
    (b"[DataSet]", Format::Nanosurf),
    (b"GWYP", Format::Gwyddion),
    (b"GWYO", Format::Gwyddion),
    (b"Gwyddion Simple Field 1.", Format::Gsf),
    (b"\x89HDF\r\n\x1a\n", Format::Hdf5),
    (b"# thermal noise data", Format::JpkThermal),
    (b"Force-Distance Curve", Format::Workshop),
    (b"HE UFF_code", Format::Uff),
    (b"WSxM file copyright", Format::Wsxm),
    (b"\xEF\xBB\xBFForce-Distance Curve", Format::Workshop),
];

/// Recognises a file by its content; `None` if its format is not known here.
pub fn recognise(bytes: &[u8]) -> Option<Format> {
    let format = by_beginning(bytes)?;
    let is_jpk = || Directory::read(bytes).is_ok_and(|of| of.find(jpk::HEADER).is_some());
    Some(match format {
        Format::Zip if is_jpk() => Format::Jpk,
        format => format,
    })
}

/// Recognises a file by its first [`BEGINNING`] bytes; an archive of JPK is a zip archive by these.
pub(crate) fn by_beginning(bytes: &[u8]) -> Option<Format> {
    if let Some((_, format)) = BEGINNINGS
        .iter()
        .find(|(first, _)| bytes.starts_with(first))
    {
        return Some(*format);
    }
    if bytes.starts_with(b"MM\0*") || bytes.starts_with(b"II*\0") {
        return Some(Format::JpkImage);
    }
    if bytes.get(8..12) == Some(b"ARDF") {
        return Some(Format::Ardf);
    }
    let head = &bytes[..bytes.len().min(BEGINNING)];
    if head.starts_with(b"Date\t") && latin1(head).contains("Device:\tChiaro") {
        return Some(Format::Chiaro);
    }
    let is_asd = head.len() > 64
        && matches!(head[..4], [0..=2, 0, 0, 0])
        && head[..40].windows(2).any(|two| two == b"TP");
    if is_asd {
        return Some(Format::Asd);
    }
    if igor::version(bytes).is_some() {
        return Some(Format::Igor);
    }
    if igor::is_experiment(head) {
        return Some(Format::IgorExperiment);
    }
    ntmdt::begins(head).then_some(Format::NtMdtText)
}

/// The beginning of a file, to show it.
pub(crate) fn beginning(bytes: &[u8]) -> String {
    let first = &bytes[..bytes.len().min(16)];
    if first.is_empty() {
        return "nothing, the file is empty".to_owned();
    }
    let is_text = first
        .iter()
        .all(|of| matches!(of, b' '..=b'~' | b'\t' | b'\r' | b'\n'));
    if is_text {
        return format!("the text {:?}", latin1(first));
    }
    let bytes: Vec<String> = first.iter().map(|of| format!("{of:02x}")).collect();
    format!("the bytes {}", bytes.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_is_recognised_whatever_the_name() {
        assert_eq!(
            recognise(b"\\*Force file list\r\n"),
            Some(Format::Nanoscope)
        );
        assert_eq!(recognise(b"GWYP...."), Some(Format::Gwyddion));
        assert_eq!(recognise(b"-1,5\t0,25\t1,0\r\n"), Some(Format::NtMdtText));
        assert_eq!(recognise(b"distance,amplitude\n1,2\n"), None);
        assert_eq!(recognise(b""), None);
    }

    #[test]
    fn the_beginning_of_an_unknown_file_is_shown() {
        assert_eq!(beginning(b"z,a\n"), "the text \"z,a\\n\"");
        assert_eq!(beginning(&[0xff, 0]), "the bytes ff 00");
    }
}
