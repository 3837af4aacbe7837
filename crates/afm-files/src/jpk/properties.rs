//! Java property files of JPK, and the shared properties that they refer to.

use std::collections::BTreeMap;

use crate::limits::{MAX_HEADER, MAX_LINE, MAX_PROPERTIES, at_most};
use crate::text::{latin1, number};
use crate::{Error, Format};

/// References of one place.
const MAX_REFERENCES: usize = 16;

/// Properties by their keys.
pub(super) type Properties = BTreeMap<String, String>;

/// Reads lines `key=value`; `#` or `!` begins a comment.
pub(super) fn parse(bytes: &[u8]) -> Result<Properties, Error> {
    at_most(bytes.len(), MAX_HEADER, "bytes in a header")?;
    let mut properties = Properties::new();
    for line in latin1(bytes).lines() {
        at_most(line.len(), MAX_LINE, "bytes in a line of a header")?;
        let line = line.trim();
        if line.starts_with(['#', '!']) {
            continue;
        }
        if let Some((key, value)) = line.split_once('=') {
            properties.insert(key.trim().to_owned(), unescape(value.trim()));
            at_most(properties.len(), MAX_PROPERTIES, "properties in a header")?;
        }
    }
    Ok(properties)
}

/// A value without its backslashes: `\:` is `:`, `\u00b5` is `µ`.
fn unescape(value: &str) -> String {
    let mut text = String::with_capacity(value.len());
    let mut rest = value.chars();
    while let Some(of) = rest.next() {
        if of != '\\' {
            text.push(of);
            continue;
        }
        match rest.next() {
            Some('u') => {
                let digits: String = rest.by_ref().take(4).collect();
                let code = u32::from_str_radix(&digits, 16).ok();
                text.push(code.and_then(char::from_u32).unwrap_or('\u{FFFD}'));
            }
            Some('t') => text.push('\t'),
            Some('n') => text.push('\n'),
            Some(other) => text.push(other),
            None => {}
        }
    }
    text
}

/// A header with the shared properties: a key that ends in `.*` with the value N, such as
/// `channel.X.lcd-info.*=N`, stands for every shared `lcd-info.N.REST` as `channel.X.REST`. The
/// header's own keys win.
#[derive(Debug)]
pub(super) struct Header<'a> {
    own: Properties,
    shared: &'a Properties,
    /// Beginnings of the shared keys that stand for those at a place.
    references: BTreeMap<String, Vec<String>>,
}

impl<'a> Header<'a> {
    pub(super) fn new(own: Properties, shared: &'a Properties) -> Result<Self, Error> {
        let mut references: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for (key, number) in &own {
            let Some(key) = key.strip_suffix(".*") else {
                continue;
            };
            let (place, kind) = key.rsplit_once('.').unwrap_or(("", key));
            let of_place = references.entry(place.to_owned()).or_default();
            of_place.push(format!("{kind}.{number}."));
            at_most(
                of_place.len(),
                MAX_REFERENCES,
                "references to shared properties",
            )?;
        }
        Ok(Self {
            own,
            shared,
            references,
        })
    }

    pub(super) fn get(&self, key: &str) -> Option<&str> {
        if let Some(value) = self.own.get(key) {
            return Some(value);
        }
        let dots = key
            .match_indices('.')
            .map(|(at, _)| (&key[..at], &key[at + 1..]));
        let mut places = dots.chain([("", key)]);
        places.find_map(|(place, rest)| {
            let mut beginnings = self.references.get(place)?.iter();
            let found = beginnings.find_map(|first| self.shared.get(&format!("{first}{rest}")))?;
            Some(found.as_str())
        })
    }

    /// The finite number at a key; an error if the value is none.
    pub(super) fn number(&self, key: &str) -> Result<Option<f64>, Error> {
        let Some(text) = self.get(key) else {
            return Ok(None);
        };
        let found = number(text);
        found.map(Some).ok_or_else(|| {
            Format::Jpk.at_key(key, format!("the value `{text}`"), "a finite number")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_and_comments_of_properties_are_read() {
        let text = b"#comment\r\ntime=16\\:29\\u00b5\n key = a=b \n";
        let properties = parse(text).expect("properties");
        assert_eq!(properties["time"], "16:29µ");
        assert_eq!(properties["key"], "a=b");
    }

    #[test]
    fn shared_properties_are_found_and_own_ones_win() {
        let own = parse(b"channel.h.lcd-info.*=3\nchannel.h.unit=m\n").expect("properties");
        let shared = parse(b"lcd-info.3.unit=V\nlcd-info.3.type=x\n").expect("properties");
        let header = Header::new(own, &shared).expect("a header");
        assert_eq!(header.get("channel.h.unit"), Some("m"));
        assert_eq!(header.get("channel.h.type"), Some("x"));
        assert_eq!(header.get("channel.g.type"), None);
        assert!(header.number("channel.h.type").is_err());
    }
}
