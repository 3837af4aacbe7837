//! zlib streams of chunks, with one compressor per thread.
//!
//! A compressor has a third of a megabyte. Allocating it a thousand times per second cost a tenth
//! of a sweep, and more with more threads.

use std::cell::RefCell;

use miniz_oxide::deflate::core::{
    CompressorOxide, TDEFLFlush, TDEFLStatus, compress, create_comp_flags_from_zip_params,
};

/// Compression level of zlib: repeating motions are compressed to almost nothing at this level, and
/// the digits of chaotic ones cannot be compressed at any level.
pub(super) const LEVEL: u8 = 3;
/// Largest overhead of zlib for incompressible data, in addition to its header: five bytes for
/// every block of 31 KiB.
const OVERHEAD: (usize, usize) = (64, 4096);

thread_local! {
    /// The compressor of each thread.
    static COMPRESSOR: RefCell<CompressorOxide> = RefCell::new(compressor());
}

fn compressor() -> CompressorOxide {
    // With zlib's header and checksum.
    CompressorOxide::new(create_comp_flags_from_zip_params(i32::from(LEVEL), 1, 0))
}

/// Compresses bytes to a zlib stream, which does not depend on what was compressed before.
pub(super) fn deflate(bytes: &[u8]) -> Vec<u8> {
    COMPRESSOR.with_borrow_mut(|compressor| {
        compressor.reset();
        let (mut left, mut written) = (bytes, 0);
        let mut stream = vec![0; bytes.len() / 2 + OVERHEAD.0];
        loop {
            let (status, taken, made) =
                compress(compressor, left, &mut stream[written..], TDEFLFlush::Finish);
            (left, written) = (&left[taken..], written + made);
            // Any failure other than lack of space would be an error in the compressor. The stream
            // is then incomplete, which the reader detects by its checksum.
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

    /// Repeating data, data without a pattern, no data.
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
