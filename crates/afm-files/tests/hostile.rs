//! Damaged and hostile files: whatever the bytes are, reading ends soon, with a result or an error,
//! within bounded memory.

mod samples;

use std::io::Cursor;
use std::time::{Duration, Instant};

use afm_files::{Error, Limits, read, read_from, read_within};

/// Changes of each file, and of each archive.
const CHANGES: usize = 1500;
const ARCHIVE_CHANGES: usize = 500;
/// Curves that are decoded of each file.
const CURVES: usize = 50;
/// Longest time for one file. Real files take a hundredth of it; the machine may be busy.
const LONGEST: Duration = Duration::from_secs(2);

/// Memory of the whole test. Each file may decode 16 MiB at a time.
const MOST_MEMORY: u64 = 128 << 20;

/// The same numbers in every run (SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut of = self.0;
        of = (of ^ (of >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        of = (of ^ (of >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        of ^ (of >> 31)
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit.max(1) as u64) as usize
    }
}

/// Reads a file and its first curves.
fn exhaust(name: &str, bytes: Vec<u8>) {
    let begin = Instant::now();
    let limits = Limits::with_decoded_bytes(16 << 20);
    // Some from memory, some as from a disk.
    let document = if bytes.len().is_multiple_of(2) {
        read_within(bytes, limits)
    } else {
        read_from(Cursor::new(bytes), limits)
    };
    if let Ok(document) = document {
        document.number_at([1, 0]);
        for number in 0..document.curve_count().min(CURVES) {
            if let Ok(curve) = document.curve(number) {
                for segment in &curve.segments {
                    let points = segment.points();
                    assert!(
                        segment.channels.iter().all(|of| of.values.len() == points),
                        "{name}: channels of different lengths"
                    );
                }
            }
        }
        for image in &document.images {
            assert_eq!(
                image.values.len(),
                image.shape[0] * image.shape[1],
                "{name}: an image of another size"
            );
        }
    }
    let took = begin.elapsed();
    assert!(took < LONGEST, "{name}: {took:?}");
}

/// Changes a few bytes or a number in some bytes.
fn change(bytes: &mut Vec<u8>, numbers: &mut Numbers) {
    if bytes.is_empty() {
        return;
    }
    let at = numbers.below(bytes.len());
    match numbers.below(6) {
        0 => bytes.truncate(at),
        1 => bytes[at] ^= 1 << numbers.below(8),
        2 => bytes[at] = numbers.below(256) as u8,
        // A count of 32 bits.
        3 => {
            let count =
                [0, 1, 0x7FFF_FFFF, 0xFFFF_FFFF, 0x0001_0000, 0x00FF_0000_u32][numbers.below(6)];
            for (k, byte) in count.to_le_bytes().into_iter().enumerate() {
                if let Some(place) = bytes.get_mut(at + k) {
                    *place = byte;
                }
            }
        }
        // A number of the text.
        4 => {
            if let Some(digit) = bytes[at..].iter().position(u8::is_ascii_digit) {
                let hostile =
                    ["99999999999", "-1", "1e308", "NaN", "0", "1000000"][numbers.below(6)];
                bytes.splice(at + digit..=at + digit, hostile.bytes());
            }
        }
        // A part again.
        _ => {
            let end = bytes.len().min(at + 64);
            let part = bytes[at..end].to_vec();
            bytes.splice(at..at, part);
        }
    }
}

#[test]
fn truncated_files_end_with_a_result_or_an_error() {
    let archives = samples::archives()
        .into_iter()
        .map(|(name, files)| (name, samples::zip(&files)));
    for (name, bytes) in samples::files().into_iter().chain(archives) {
        let step = bytes.len() / 400 + 1;
        for length in (0..bytes.len()).step_by(step) {
            exhaust(name, bytes[..length].to_vec());
        }
    }
}

#[test]
fn changed_files_end_with_a_result_or_an_error() {
    for (name, bytes) in samples::files() {
        let mut numbers = Numbers(1);
        for _ in 0..CHANGES {
            let mut changed = bytes.clone();
            for _ in 0..=numbers.below(3) {
                change(&mut changed, &mut numbers);
            }
            exhaust(name, changed);
        }
    }
    if let Some(bytes) = samples::largest_memory() {
        assert!(bytes < MOST_MEMORY, "{bytes} bytes of memory");
    }
}

#[test]
fn changed_archives_end_with_a_result_or_an_error() {
    for (name, files) in samples::archives() {
        let mut numbers = Numbers(2);
        for round in 0..ARCHIVE_CHANGES {
            let mut files = files.clone();
            // The files in the archive, so that their checksums are right, or the archive itself.
            if round % 4 > 0 {
                let which = numbers.below(files.len());
                change(&mut files[which].1, &mut numbers);
            }
            let mut bytes = samples::zip(&files);
            if round % 4 == 0 {
                change(&mut bytes, &mut numbers);
            }
            exhaust(name, bytes);
        }
    }
}

#[test]
fn an_archive_that_unpacks_to_more_than_the_limit_is_refused() {
    let mut files = samples::jpk_force();
    let bomb = files
        .iter_mut()
        .find(|(name, _)| name.ends_with("0/channels/height.dat"));
    bomb.expect("a channel").1 = vec![0; 32 << 20];
    let bytes = samples::zip(&files);
    let document =
        read_within(bytes, Limits::with_decoded_bytes(1 << 20)).expect("the headers fit");
    let error = document.curve(0).expect_err("the curve does not");
    assert!(
        matches!(
            error,
            Error::Limit {
                quantity: "decoded bytes",
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn archives_with_repeated_or_overlapping_files_are_refused() {
    let mut files = samples::jpk_force();
    files.push(files[2].clone());
    let error = read(samples::zip(&files)).expect_err("a repeated name");
    assert!(
        error.to_string().contains("a second file of this name"),
        "{error}"
    );

    let files = ["a.csv", "b.csv"].map(|name| (name.to_owned(), samples::workshop(1)));
    let mut bytes = samples::zip(&files);
    // The first file claims the second one's bytes too.
    let directory = bytes
        .windows(4)
        .position(|of| of == b"PK\x01\x02")
        .expect("a record");
    let length = (directory - 30 - "a.csv".len()) as u32;
    bytes[directory + 20..directory + 24].copy_from_slice(&length.to_le_bytes());
    let error = read(bytes).expect_err("overlapping files");
    assert!(
        error
            .to_string()
            .contains("its bytes are also another file's"),
        "{error}"
    );
}

#[test]
fn a_tiff_whose_directories_run_in_a_circle_is_refused() {
    let mut bytes = samples::jpk_image();
    let first = bytes[4..8].to_vec();
    let end = bytes.len();
    bytes[end - 4..].copy_from_slice(&first);
    let error = read(bytes).expect_err("a circle");
    assert!(error.to_string().contains("for the second time"), "{error}");
}

#[test]
fn objects_within_objects_end() {
    let mut bytes = b"GWYP".to_vec();
    let mut inner = Vec::new();
    for _ in 0..5000 {
        inner = [
            b"X\0".as_slice(),
            &(inner.len() as u32).to_le_bytes(),
            &inner,
        ]
        .concat();
        inner = [b"a\0o".as_slice(), &inner].concat();
    }
    bytes.extend(
        [
            b"X\0".as_slice(),
            &(inner.len() as u32).to_le_bytes(),
            &inner,
        ]
        .concat(),
    );
    let error = read(bytes).expect_err("too deep");
    assert!(
        matches!(
            error,
            Error::Limit {
                quantity: "objects within objects",
                ..
            }
        ),
        "{error}"
    );
}

/// Archives that would take much more memory or time than their length suggests.
#[test]
fn bombs_cost_little() {
    let shared = "shared-data/header.properties".to_owned();
    let header = "segments/0/segment-header.properties".to_owned();
    let encoder = "lcd-info.0.encoder.type=signedshort\nlcd-info.0.encoder.scaling.multiplier=1\n";
    let lines = |line: &dyn Fn(usize) -> String| -> Vec<u8> {
        (0..20_000).flat_map(|k| line(k).into_bytes()).collect()
    };
    let file = |channel: usize| format!("segments/0/channels/c{channel}.dat");
    // 20,000 references to 20,000 properties, at one place and at many.
    let product = |place: &dyn Fn(usize) -> String| {
        vec![
            (shared.clone(), lines(&|k| format!("a.0.k{k}=1\n"))),
            (header.clone(), lines(&|k| format!("{}.*=0\n", place(k)))),
            (file(0), vec![0; 100]),
        ]
    };
    // 100 channels of 100,000 points.
    let mut wide = vec![
        (shared.clone(), encoder.as_bytes().to_vec()),
        (
            header.clone(),
            lines(&|k| format!("channel.c{k}.lcd-info.*=0\n")),
        ),
    ];
    wide.extend((0..100).map(|channel| (file(channel), vec![0; 200_000])));
    // Properties of 30 MiB.
    let heading = vec![
        (shared.clone(), b"a=\n".repeat(10 << 20)),
        (file(0), Vec::new()),
    ];
    let bombs = [
        ("product at many places", product(&|k| format!("p{k}.a"))),
        ("product at one place", product(&|k| format!("p.a{k}"))),
        ("wide", wide),
        ("heading", heading),
    ];
    for (name, files) in bombs {
        exhaust(name, samples::zip(&files));
    }
}
