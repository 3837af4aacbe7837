//! The share of the chunks that one machine computes.

use std::fmt;
use std::str::FromStr;

/// The `index`-th of `count` shares: the chunks `index − 1`, `index − 1 + count`, … (shares count
/// from 1, chunks from 0), so that expensive and cheap regions are distributed evenly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    index: usize,
    count: usize,
}

/// A text that is not a share `i/n` with 1 ≤ i ≤ n.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{given}` is not a share: expected i/n with 1 ≤ i ≤ n, as in 2/8 for the second of eight")]
pub struct ShareError {
    /// Text as given.
    pub given: String,
}

impl Share {
    /// The share of a single machine: all chunks.
    pub const WHOLE: Self = Self { index: 1, count: 1 };

    /// Returns true if `chunk` is in the share.
    pub fn holds(self, chunk: usize) -> bool {
        chunk % self.count == self.index - 1
    }

    /// Returns true if the share contains all chunks.
    pub fn is_whole(self) -> bool {
        self.count == 1
    }
}

impl Default for Share {
    fn default() -> Self {
        Self::WHOLE
    }
}

impl FromStr for Share {
    type Err = ShareError;

    fn from_str(given: &str) -> Result<Self, ShareError> {
        let refuse = || ShareError {
            given: given.to_owned(),
        };
        let (index, count) = given.split_once('/').ok_or_else(refuse)?;
        let number = |text: &str| text.trim().parse::<usize>().map_err(|_| refuse());
        let (index, count) = (number(index)?, number(count)?);
        if index == 0 || index > count {
            return Err(refuse());
        }
        Ok(Self { index, count })
    }
}

impl fmt::Display for Share {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_cover_everything_once() {
        for count in 1..9 {
            let shares: Vec<Share> = (1..=count)
                .map(|i| format!("{i}/{count}").parse().unwrap())
                .collect();
            for chunk in 0..50 {
                assert_eq!(shares.iter().filter(|s| s.holds(chunk)).count(), 1);
            }
        }
    }

    #[test]
    fn what_is_no_share_is_refused() {
        for given in [
            "", "1", "0/3", "4/3", "-1/3", "1/0", "a/b", "1/2/3", "1.5/3",
        ] {
            assert!(given.parse::<Share>().is_err(), "{given}");
        }
        assert_eq!(" 2 / 8 ".parse::<Share>().unwrap().to_string(), "2/8");
    }
}
