//! Numbers in the bytes of a file, every access checked.

use crate::{Error, Format};

/// Kind of a stored number; the size is in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Number {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Number {
    pub(crate) const fn size(self) -> usize {
        match self {
            Self::Signed(size) | Self::Unsigned(size) | Self::Float(size) => size,
        }
    }
}

/// Kind and byte order of stored numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Encoding {
    pub(crate) number: Number,
    pub(crate) big_endian: bool,
}

impl Encoding {
    pub(crate) const fn little(number: Number) -> Self {
        Self {
            number,
            big_endian: false,
        }
    }

    pub(crate) const fn big(number: Number) -> Self {
        Self {
            number,
            big_endian: true,
        }
    }

    pub(crate) const fn size(self) -> usize {
        self.number.size()
    }

    fn bits(self, bytes: &[u8]) -> u64 {
        let mut raw = [0_u8; 8];
        if self.big_endian {
            raw[8 - bytes.len()..].copy_from_slice(bytes);
            u64::from_be_bytes(raw)
        } else {
            raw[..bytes.len()].copy_from_slice(bytes);
            u64::from_le_bytes(raw)
        }
    }

    fn one(self, bytes: &[u8]) -> f64 {
        let bits = self.bits(bytes);
        match self.number {
            Number::Signed(size) => {
                let unused = 64 - 8 * size as u32;
                (((bits << unused) as i64) >> unused) as f64
            }
            Number::Unsigned(_) => bits as f64,
            Number::Float(4) => f64::from(f32::from_bits(bits as u32)),
            Number::Float(_) => f64::from_bits(bits),
        }
    }

    /// The numbers in some bytes; an incomplete one at the end is left out.
    pub(crate) fn all(self, bytes: &[u8]) -> impl DoubleEndedIterator<Item = f64> + '_ {
        bytes.chunks_exact(self.size()).map(move |of| self.one(of))
    }
}

/// Bytes of a file of this format.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bytes<'a> {
    pub(crate) data: &'a [u8],
    pub(crate) format: Format,
}

impl<'a> Bytes<'a> {
    pub(crate) const fn new(data: &'a [u8], format: Format) -> Self {
        Self { data, format }
    }

    /// So many bytes from this place on.
    pub(crate) fn slice(&self, at: usize, length: usize) -> Result<&'a [u8], Error> {
        let found = at
            .checked_add(length)
            .and_then(|end| self.data.get(at..end));
        found.ok_or_else(|| {
            let problem = format!("{length} bytes are needed here");
            let expected = format!("a file longer than {} bytes", self.data.len());
            self.format.at_byte(at, problem, expected)
        })
    }

    /// A whole number of `size` bytes, at most 8.
    pub(crate) fn whole(&self, at: usize, size: usize, big_endian: bool) -> Result<u64, Error> {
        let encoding = Encoding {
            number: Number::Unsigned(size),
            big_endian,
        };
        Ok(encoding.bits(self.slice(at, size)?))
    }

    pub(crate) fn u16_le(&self, at: usize) -> Result<usize, Error> {
        Ok(self.whole(at, 2, false)? as usize)
    }

    pub(crate) fn u32_le(&self, at: usize) -> Result<usize, Error> {
        Ok(self.whole(at, 4, false)? as usize)
    }

    pub(crate) fn u64_le(&self, at: usize) -> Result<usize, Error> {
        let number = self.whole(at, 8, false)?;
        usize::try_from(number).map_err(|_| {
            let problem = format!("the number {number}");
            self.format.at_byte(at, problem, "a place in this file")
        })
    }

    pub(crate) fn f64(&self, at: usize, big_endian: bool) -> Result<f64, Error> {
        Ok(f64::from_bits(self.whole(at, 8, big_endian)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_kind_and_order_are_decoded() {
        let all = |encoding: Encoding, bytes: &[u8]| encoding.all(bytes).collect::<Vec<_>>();
        assert_eq!(
            all(Encoding::little(Number::Signed(2)), &[0xFE, 0xFF, 1, 0]),
            [-2.0, 1.0]
        );
        assert_eq!(all(Encoding::big(Number::Unsigned(2)), &[1, 0, 9]), [256.0]);
        assert_eq!(
            all(Encoding::big(Number::Signed(8)), &(-5_i64).to_be_bytes()),
            [-5.0]
        );
        assert_eq!(
            all(Encoding::little(Number::Float(4)), &1.5_f32.to_le_bytes()),
            [1.5]
        );
        assert_eq!(
            all(Encoding::big(Number::Float(8)), &0.1_f64.to_be_bytes()),
            [0.1]
        );
    }

    #[test]
    fn a_slice_beyond_the_end_is_an_error_that_says_where() {
        let bytes = Bytes::new(&[1, 2, 3], Format::Gwyddion);
        assert_eq!(bytes.slice(1, 2), Ok(&[2_u8, 3][..]));
        let error = bytes.slice(2, usize::MAX).expect_err("beyond the end");
        assert!(error.to_string().contains("byte 2"), "{error}");
    }
}
