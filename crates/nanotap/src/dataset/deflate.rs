//! zlib streams of chunks, without a compressor's third of a megabyte anew for each.
//!
//! Handing that much back to the system and asking for it again, a thousand times a second,
//! cost a tenth of a sweep, and more the more threads did it.

use std::cell::RefCell;

use miniz_oxide::deflate::core::{
    CompressorOxide, TDEFLFlush, TDEFLStatus, compress, create_comp_flags_from_zip_params,
};

/// How hard zlib tries: repeating motions shrink to almost nothing already here, and
/// the digits of chaotic ones shrink nowhere.
pub(super) const LEVEL: u8 = 3;
/// What zlib adds to data that shrinks nowhere, at most, beside its header: five bytes for
/// every block of 31 KiB.
const OVERHEAD: (usize, usize) = (64, 4096);

thread_local! {
    /// Each thread's own compressor.
    static COMPRESSOR: RefCell<CompressorOxide> = RefCell::new(compressor());
}

fn compressor() -> CompressorOxide {
    // With zlib's header and checksum.
    CompressorOxide::new(create_comp_flags_from_zip_params(i32::from(LEVEL), 1, 0))
}

/// The zlib stream of some bytes; the same bytes whatever was compressed before.
pub(super) fn deflate(bytes: &[u8]) -> Vec<u8> {
    COMPRESSOR.with_borrow_mut(|compressor| {
        compressor.reset();
        let (mut left, mut written) = (bytes, 0);
        let mut stream = vec![0; bytes.len() / 2 + OVERHEAD.0];
        loop {
            let (status, taken, made) =
                compress(compressor, left, &mut stream[written..], TDEFLFlush::Finish);
            (left, written) = (&left[taken..], written + made);
            // Anything but lack of room would be a mistake in the compressor: it is then as
            // if there were none, and the reader finds the damage by its checksum.
            if status != TDEFLStatus::Okay {
                break;
            }
            stream.resize(stream.len() + bytes.len() / 2 + OVERHEAD.1, 0);
        }
        stream.truncate(written);
        stream
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use miniz_oxide::deflate::compress_to_vec_zlib;
    use miniz_oxide::inflate::decompress_to_vec_zlib;

    /// Repeating, then without any pattern, then nothing.
    fn samples() -> Vec<Vec<u8>> {
        let mut seed = 1_u64;
        let noise = (0..300_000)
            .map(|_| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (seed >> 56) as u8
            })
            .collect();
        vec![b"tap ".repeat(40_000), noise, Vec::new(), vec![7]]
    }

    #[test]
    fn streams_are_those_of_a_new_compressor_whatever_came_before() {
        for _ in 0..2 {
            for sample in samples() {
                let stream = deflate(&sample);
                assert_eq!(stream, compress_to_vec_zlib(&sample, LEVEL));
                assert_eq!(decompress_to_vec_zlib(&stream).unwrap(), sample);
            }
        }
    }
}
