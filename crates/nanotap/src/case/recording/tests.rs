//! Files made here in the instruments' formats, and files with any bytes.

use super::samples::{bombs, ibw, jpk, nid};
use crate::case::table::{Entry, Table};

fn parse(name: &str, bytes: &[u8]) -> Option<Result<Table, String>> {
    let parsed = super::parse(name, bytes)?;
    Some(match parsed {
        Ok(recorded) => Ok(Table::of_recording(name, recorded)),
        Err(error) => Err(error.to_string()),
    })
}

fn numbers(table: &Table, header: &str) -> Vec<f64> {
    let (_, column) = table
        .columns
        .iter()
        .find(|(name, _)| name == header)
        .unwrap();
    let number = |entry: &Entry| match entry {
        Entry::Number(x) => *x,
        other => panic!("{other:?}"),
    };
    column.iter().map(number).collect()
}

fn close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!(
            (a - b).abs() <= 1e-9 * b.abs().max(1e-3),
            "{found:?} {expected:?}"
        );
    }
}

#[test]
fn a_wave_of_asylum_research_is_read() {
    let table = parse("curve.IBW", &ibw()).unwrap().unwrap();
    close(&numbers(&table, "ZSnsr (nm)"), &[10.0, 20.0]);
    close(&numbers(&table, "Amp (nm)"), &[30.0, 40.0]);
    close(&numbers(&table, "Phase (deg)"), &[30.0, 31.0]);
    assert!(
        table
            .notes
            .contains(&("AmpInvOLS".to_owned(), "5.8e-08".to_owned()))
    );
}

#[test]
fn a_force_curve_of_jpk_is_read() {
    let table = parse("curve.jpk-force", &jpk()).unwrap().unwrap();
    // Volts 0.5 + raw/1000, times 70 nm/V.
    let deflection = [35.0, 0.0, 140.0, 35.0, 0.0, 140.07];
    close(&numbers(&table, "vDeflection (nm)"), &deflection);
    let height = [1000.0, 800.0, 600.0, 1000.0, 800.0, 600.0 - 2e-6];
    close(&numbers(&table, "measuredHeight (nm)"), &height);
    let (_, words) = table
        .columns
        .iter()
        .find(|(name, _)| name == "direction")
        .unwrap();
    let text = |word: &str| Entry::Text(word.to_owned());
    assert_eq!(words[2..4], [text("approach"), text("retract")]);
    for note in [("InvOLS", 7e-8), ("SpringConstant", 0.043)] {
        let (_, value) = table.notes.iter().find(|(name, _)| name == note.0).unwrap();
        assert_eq!(value.parse::<f64>().unwrap(), note.1);
    }
}

#[test]
fn a_spectroscopy_of_nanosurf_is_read() {
    let table = parse("curve.nid", &nid()).unwrap().unwrap();
    // Range 2 µm of 65536 levels, and 20 V.
    close(
        &numbers(&table, "Z-Axis (nm)"),
        &[0.0, 1000.0, 1500.0, 1500.0, 1000.0, 0.0],
    );
    close(
        &numbers(&table, "Deflection (V)"),
        &[10.0, 10.0, 12.5, 12.5, 10.0, 10.0],
    );
    assert!(
        table
            .notes
            .contains(&("InvOLS".to_owned(), "0.0000001".to_owned()))
    );
    assert!(
        table
            .notes
            .contains(&("SpringConstant".to_owned(), "0.2".to_owned()))
    );
}

#[test]
fn damaged_files_are_refused_or_read() {
    // SplitMix64 (Steele, Lea, Flood 2014).
    let mut state = 1_u64;
    let mut random = move |below: usize| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % below as u64) as usize
    };
    let files = [("a.ibw", ibw()), ("a.jpk-force", jpk()), ("a.nid", nid())];
    let mut read = 0;
    for (name, whole) in &files {
        for end in 0..whole.len().min(600) {
            let _ = parse(name, &whole[..end]).unwrap();
        }
        for _ in 0..3000 {
            let mut file = whole.clone();
            for _ in 0..=random(4) {
                let at = random(file.len());
                file[at] = [0, 0xff, 0x7f, 0x80, random(256) as u8][random(5)];
            }
            file.truncate(file.len() - random(2) * random(file.len()));
            read += usize::from(parse(name, &file).unwrap().is_ok());
        }
    }
    assert!((100..9000).contains(&read), "{read}");
    assert!(parse("a.csv", b"x").is_none());
}

/// Of each bomb the reason, so that it is not refused for another one; none is unpacked.
#[test]
fn bombs_are_refused_with_the_reason() {
    let reasons = [
        ("product", "it has more than 67108864 bytes of properties"),
        (
            "repeated",
            "its archive has two files called `segments/0/channels/x.dat`",
        ),
        ("misplaced", "or it is damaged"),
        (
            "unequal",
            "the file `segments/0/channels/c0.dat` in its archive is not as long as stated",
        ),
        ("nested", "two files in its archive share bytes"),
        (
            "long",
            "it has more than 67108864 bytes in the files of its archive",
        ),
        ("wide", "it has more than 8000000 numbers"),
        (
            "heading",
            "it has more than 67108864 bytes in the files of its archive",
        ),
    ];
    for ((name, bytes), (expected, reason)) in bombs().into_iter().zip(reasons) {
        assert_eq!(name, expected);
        let refused = parse("bomb.jpk-force", &bytes).unwrap().unwrap_err();
        assert!(refused.contains(reason), "{name}: {refused}");
    }
}

/// Sizes that a file only states cost nothing, and many empty channels little.
#[test]
fn stated_sizes_take_no_memory() {
    let mut wave = ibw();
    wave[64 + 68..64 + 72].copy_from_slice(&i32::MAX.to_le_bytes());
    let refused = parse("a.ibw", &wave).unwrap().unwrap_err();
    assert!(refused.contains("more than 1000000 rows"), "{refused}");
    let mut text = String::from("[DataSet]\nGroupCount=1000\n");
    let groups =
        (0..1000).map(|group| format!("Gr{group}-Count=1000\nGr{group}-Ch0=E\nGr{group}-Ch1=E\n"));
    text.extend(groups);
    text += "[E]\nPoints=0\nLines=0\nSaveBits=16\n#!";
    let refused = parse("a.nid", text.as_bytes()).unwrap().unwrap_err();
    assert!(refused.contains("more than 1000 channels"), "{refused}");
    let long = format!("[A]\n{}#!", "k=v\n".repeat(2 << 20));
    let refused = parse("a.nid", long.as_bytes()).unwrap().unwrap_err();
    assert!(refused.contains("bytes in its header"), "{refused}");
}
