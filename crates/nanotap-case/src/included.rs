//! Files whose content stands in a case in place of their name, as an address `data:…` (RFC 2397), so
//! that the case is one text.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

const SCHEME: &str = "data:";
const ENCODING: &str = ";base64";
const NAME: &str = ";name=";

/// The address that holds the content of a file.
pub(crate) fn address(name: &str, bytes: &[u8]) -> String {
    // What would end the name, or the text in quotes around it.
    let kept = |c: char| c.is_alphanumeric() || "._- ".contains(c);
    let name: String = name
        .chars()
        .map(|c| if kept(c) { c } else { '_' })
        .collect();
    format!("{SCHEME}{NAME}{name}{ENCODING},{}", STANDARD.encode(bytes))
}

/// Whether a name is such an address.
pub(crate) fn is_address(name: &str) -> bool {
    name.starts_with(SCHEME)
}

/// The name of the file and its content, in base64 or as it is; `None` if the address is damaged.
pub(crate) fn content(address: &str) -> Option<(&str, Vec<u8>)> {
    let (head, content) = address.strip_prefix(SCHEME)?.split_once(',')?;
    let (head, bytes) = match head.strip_suffix(ENCODING) {
        Some(head) => (head, STANDARD.decode(content.trim()).ok()?),
        None => (head, content.as_bytes().to_vec()),
    };
    let name = head
        .split_once(NAME)
        .map_or("included file", |(_, name)| name);
    Some((name, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_file_comes_back(name in ".{0,20}", bytes: Vec<u8>) {
            let address = address(&name, &bytes);
            prop_assert!(is_address(&address) && !address.contains(['"', '\'', '\\', '\n']));
            let (shown, back) = content(&address).unwrap();
            prop_assert_eq!(back, bytes);
            prop_assert_eq!(shown.chars().count(), name.chars().count());
        }
    }

    #[test]
    fn a_damaged_address_has_no_content() {
        for wrong in ["data:", "data:;base64,%", "step.csv"] {
            assert_eq!(content(wrong), None, "{wrong}");
        }
        assert_eq!(content("data:,1"), Some(("included file", b"1".to_vec())));
    }
}
