//! Links that hold a case: the page that they lead to opens it, and nothing is sent anywhere.
//!
//! The fragment of the address is `#case=`, the version of the form, and the text of the case file,
//! deflated, in base64url. Further fields of the fragment are the page's own: its view, its studies.

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use miniz_oxide::deflate::compress_to_vec;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};

/// The address of the published page.
pub const PAGE: &str = env!("CARGO_PKG_HOMEPAGE");
/// The version of the form.
const VERSION: char = '1';
/// Level of the compression.
const LEVEL: u8 = 10;
/// Characters that a field of a fragment escapes.
const ESCAPED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_');

/// The link that opens a case file in the page at an address.
///
/// ```
/// use nanotap_explorer::link::{PAGE, link};
///
/// let link = link(PAGE, "[model]\nkind = \"paper\"\n");
/// assert!(link.starts_with(&format!("{PAGE}#case=1")));
/// ```
pub fn link(page: &str, case: &str) -> String {
    let packed = URL_SAFE_NO_PAD.encode(compress_to_vec(case.as_bytes(), LEVEL));
    format!("{page}#case={VERSION}{packed}")
}

/// The link to a case with other values of keys: further fields of the fragment.
///
/// ```
/// use nanotap_explorer::link::with_changes;
///
/// let link = with_changes("#case=1AA", &[("gap.tip", "9 nm")]);
/// assert_eq!(link, "#case=1AA&set.gap.tip=9%20nm");
/// ```
pub fn with_changes(link: &str, set: &[(&str, &str)]) -> String {
    let field = |(key, value): &(&str, &str)| {
        let [key, value] = [key, value].map(|text| utf8_percent_encode(text, ESCAPED));
        format!("&set.{key}={value}")
    };
    link.to_owned() + &set.iter().map(field).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use miniz_oxide::inflate::decompress_to_vec;

    #[test]
    fn every_worked_case_fits_in_a_link_and_comes_back() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/cases");
        let mut count = 0;
        for entry in std::fs::read_dir(folder).unwrap().flatten() {
            if entry
                .path()
                .extension()
                .is_none_or(|ending| ending != "toml")
            {
                continue;
            }
            let text = std::fs::read_to_string(entry.path()).unwrap();
            let link = link("", &text);
            // A QR code holds 2331 characters with medium correction.
            assert!(
                link.len() < 2331,
                "{}: {}",
                entry.path().display(),
                link.len()
            );
            let packed = link.strip_prefix("#case=1").unwrap();
            let inflated = decompress_to_vec(&URL_SAFE_NO_PAD.decode(packed).unwrap()).unwrap();
            assert_eq!(String::from_utf8(inflated).unwrap(), text);
            count += 1;
        }
        assert!(count > 20);
    }
}
