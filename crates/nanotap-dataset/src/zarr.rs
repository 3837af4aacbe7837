//! The Zarr format, version 2: metadata documents and the bytes of a chunk.
//!
//! <https://zarr-specs.readthedocs.io/en/latest/v2/v2.0.html>, with xarray's `_ARRAY_DIMENSIONS`
//! for the names of dimensions and `.zmetadata` for all metadata in one document. Chunks are zlib
//! streams of little-endian numbers in C order.

use miniz_oxide::inflate::decompress_to_vec_zlib_with_limit;
use serde_json::{Value, json};

use super::deflate::{LEVEL, deflate};
use super::schema::{Attributes, Kind, Values};

/// Names of the metadata documents of Zarr.
pub(super) const GROUP: &str = ".zgroup";
pub(super) const ATTRIBUTES: &str = ".zattrs";
pub(super) const ARRAY: &str = ".zarray";
pub(super) const CONSOLIDATED: &str = ".zmetadata";
/// Separator of the numbers in the name of a chunk; a dot by default.
pub(super) const SEPARATOR: &str = "dimension_separator";

/// The content of a `.zgroup` document.
pub(super) fn group() -> Value {
    json!({ "zarr_format": 2 })
}

/// The `.zarray` document of an array, with chunks in folders if `nested`.
pub(super) fn array(shape: &[usize], chunks: &[usize], kind: Kind, nested: bool) -> Value {
    // With a fill value xarray would convert integers to floats.
    let fill = if kind == Kind::Real {
        json!("NaN")
    } else {
        Value::Null
    };
    let mut document = json!({
        "zarr_format": 2,
        "shape": shape,
        "chunks": chunks,
        "dtype": dtype(kind),
        "compressor": { "id": "zlib", "level": LEVEL },
        "fill_value": fill,
        "order": "C",
        "filters": null,
    });
    if nested {
        document[SEPARATOR] = "/".into();
    }
    document
}

fn dtype(kind: Kind) -> String {
    match kind {
        Kind::Real => "<f8".into(),
        Kind::Whole => "<i4".into(),
        Kind::Code => "|u1".into(),
        Kind::Text(length) => format!("<U{length}"),
    }
}

/// The type named in a `.zarray` document, if nanotap uses it.
pub(super) fn kind(dtype: &str) -> Option<Kind> {
    match dtype {
        "<f8" => Some(Kind::Real),
        "<i4" => Some(Kind::Whole),
        "|u1" => Some(Kind::Code),
        other => other
            .strip_prefix("<U")?
            .parse()
            .ok()
            .filter(|length| *length <= usize::MAX / 8)
            .map(Kind::Text),
    }
}

/// The `.zattrs` document of an array.
pub(super) fn attributes<'a>(
    dimensions: impl IntoIterator<Item = &'a str>,
    own: &Attributes,
) -> Value {
    let mut all = own.clone();
    let names: Vec<&str> = dimensions.into_iter().collect();
    all.insert("_ARRAY_DIMENSIONS".into(), json!(names));
    Value::Object(all)
}

/// The name of a chunk's file: its place along every dimension.
pub(super) fn chunk_name(place: &[usize], tail: usize) -> String {
    let zeros = std::iter::repeat_n(&0, tail);
    let parts: Vec<String> = place.iter().chain(zeros).map(ToString::to_string).collect();
    parts.join(".")
}

/// The file of a chunk.
pub(super) fn encode(values: &Values) -> Vec<u8> {
    let bytes: Vec<u8> = match values {
        Values::Real(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
        Values::Whole(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
        Values::Code(v) => v.clone(),
        Values::Text(words) => {
            let Kind::Text(length) = values.kind() else {
                return Vec::new();
            };
            let padded = |word: &String| {
                let letters = word.chars().map(u32::from).chain(std::iter::repeat(0));
                letters
                    .take(length)
                    .flat_map(u32::to_le_bytes)
                    .collect::<Vec<u8>>()
            };
            words.iter().flat_map(padded).collect()
        }
    };
    deflate(&bytes)
}

/// Decodes a chunk's file of `count` entries, or returns the reason why it is invalid.
pub(super) fn decode(file: &[u8], kind: Kind, count: usize) -> Result<Values, String> {
    let size = count * kind.size();
    let bytes = decompress_to_vec_zlib_with_limit(file, size).map_err(|e| e.to_string())?;
    if bytes.len() != size {
        return Err(format!("got {} bytes, expected {size}", bytes.len()));
    }
    Ok(match kind {
        Kind::Real => {
            let number = |b: &[u8]| f64::from_le_bytes(b.try_into().unwrap_or_default());
            Values::Real(bytes.chunks_exact(8).map(number).collect())
        }
        Kind::Whole => {
            let number = |b: &[u8]| i32::from_le_bytes(b.try_into().unwrap_or_default());
            Values::Whole(bytes.chunks_exact(4).map(number).collect())
        }
        Kind::Code => Values::Code(bytes),
        Kind::Text(length) => {
            let letter = |b: &[u8]| {
                char::from_u32(u32::from_le_bytes(b.try_into().unwrap_or_default()))
                    .filter(|c| *c != '\0')
            };
            let word = |b: &[u8]| b.chunks_exact(4).filter_map(letter).collect();
            Values::Text(bytes.chunks_exact(4 * length.max(1)).map(word).collect())
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_encoded_comes_back() {
        for values in [
            Values::Real(vec![0.1, -0.0, f64::INFINITY, 1e-300]),
            Values::Whole(vec![i32::MIN, 0, 7]),
            Values::Code(vec![0, 1, 255]),
            Values::Text(vec!["up".into(), String::new(), "δown".into()]),
        ] {
            let file = encode(&values);
            assert_eq!(decode(&file, values.kind(), values.len()).unwrap(), values);
            assert!(decode(&file, values.kind(), values.len() + 1).is_err());
            assert!(decode(&file[..file.len() - 5], values.kind(), values.len()).is_err());
        }
    }

    #[test]
    fn names_have_a_part_a_dimension() {
        assert_eq!(chunk_name(&[3, 0], 2), "3.0.0.0");
        assert_eq!(chunk_name(&[7], 0), "7");
    }
}
