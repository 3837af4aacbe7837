//! A map that stays on the disk: opening it and decoding its curves takes little of the memory that its
//! bytes would.

mod samples;

use std::fs;
use std::io::BufWriter;
use std::path::Path;

use afm_files::{Limits, open};

/// Curves of the map, a column of them. They have more files together than 16 bits can count.
const CURVES: usize = 6000;
/// Memory of the whole test; the file has 65 MB.
const MOST_MEMORY: u64 = 40 << 20;

#[test]
fn a_large_map_needs_little_memory() {
    let mut segments = samples::jpk_force();
    // 400 points for each of the four.
    for (name, content) in &mut segments {
        if name.contains("/channels/") {
            *content = content.repeat(100);
        }
    }
    let top = format!(
        "type=force-scan-map\nm.position-pattern.grid.ilength=1\nm.position-pattern.grid.jlength={CURVES}\n"
    );
    let shared = ["header.properties", "shared-data/header.properties"];
    let of_file = segments.iter().filter(|(name, _)| *name == shared[1]);
    let of_file = of_file.map(|(name, content)| (name.clone(), &content[..], false));
    let headers: Vec<String> = (0..CURVES)
        .map(|k| format!("force-scan-series.header.position-index={k}\n"))
        .collect();
    let of_curves = headers.iter().enumerate().flat_map(|(k, header)| {
        let parts = segments
            .iter()
            .filter(|(name, _)| !shared.contains(&name.as_str()));
        let parts =
            parts.map(move |(name, content)| (format!("index/{k}/{name}"), &content[..], false));
        let header = (format!("index/{k}/{}", shared[0]), header.as_bytes(), false);
        std::iter::once(header).chain(parts)
    });
    let top = std::iter::once((shared[0].to_owned(), top.as_bytes(), false));
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("large.jpk-force-map");
    let file = fs::File::create(&path).expect("a file");
    let mut file = BufWriter::new(file);
    samples::zip_into(&mut file, top.chain(of_file).chain(of_curves)).expect("the map");
    drop(file);
    assert!(fs::metadata(&path).expect("the map").len() > 60_000_000);

    let map = open(&path, Limits::default()).expect("a map");
    assert_eq!(map.curve_count(), CURVES);
    // Curves far from each other, in any order.
    for row in (0..CURVES).step_by(20).rev() {
        let number = map.number_at([0, row]).expect("a curve");
        let curve = map.curve(number).expect("a curve");
        assert_eq!((curve.index, curve.pixel), (row, Some(row)));
        assert_eq!(curve.segments[0].points(), 400);
    }
    if let Some(bytes) = samples::largest_memory() {
        assert!(bytes < MOST_MEMORY, "{bytes} bytes of memory");
    }
    fs::remove_file(&path).expect("the map");
}
