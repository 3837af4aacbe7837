//! Files made here in the instruments' formats, and files with any bytes.

use std::fmt::Write as _;

use super::*;
use crate::case::table::Entry;

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

/// An Igor binary wave of version 5 (WaveMetrics, Technical Note 003: `BinHeader5` of 64 bytes,
/// `WaveHeader5` of 320, data, note, labels).
fn ibw() -> Vec<u8> {
    let mut header = vec![0_u8; 384];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    let note = b"AmpInvOLS: 5.8e-08\rSpringConstant: 42\rImagingMode: AC\r";
    put(0, &5_i16.to_le_bytes());
    put(12, &(note.len() as i32).to_le_bytes());
    put(40, &(4 * 32_i32).to_le_bytes());
    put(64 + 16, &4_i16.to_le_bytes());
    put(64 + 68, &2_i32.to_le_bytes());
    put(64 + 72, &3_i32.to_le_bytes());
    let mut file = header;
    for value in [1e-8, 2e-8, 3e-8, 4e-8, 30.0, 31.0_f64] {
        file.extend(value.to_le_bytes());
    }
    file.extend(note);
    for name in ["", "ZSnsr", "Amp", "Phase"] {
        let mut label = [0_u8; 32];
        label[..name.len()].copy_from_slice(name.as_bytes());
        file.extend(label);
    }
    file
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

/// A zip archive (PKWARE, APPNOTE 6.3.10): local headers, central directory, end record. Files of
/// odd places are deflated.
fn zip(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut archive = Vec::new();
    let mut directory = Vec::new();
    for (k, (name, bytes)) in files.iter().enumerate() {
        let (method, packed) = if k % 2 == 1 {
            (8_u16, miniz_oxide::deflate::compress_to_vec(bytes, 6))
        } else {
            (0, bytes.clone())
        };
        let at = archive.len() as u32;
        let mut common = Vec::new();
        common.extend([20, 0, 0, 0]);
        common.extend(method.to_le_bytes());
        // Time and checksum, which are not read.
        common.extend([0; 8]);
        common.extend((packed.len() as u32).to_le_bytes());
        common.extend((bytes.len() as u32).to_le_bytes());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        archive.extend(b"PK\x03\x04");
        archive.extend(&common);
        archive.extend(name.as_bytes());
        archive.extend(&packed);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend(at.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let place = archive.len() as u32;
    archive.extend(&directory);
    archive.extend(b"PK\x05\x06\0\0\0\0");
    for _ in 0..2 {
        archive.extend((files.len() as u16).to_le_bytes());
    }
    archive.extend((directory.len() as u32).to_le_bytes());
    archive.extend(place.to_le_bytes());
    archive.extend([0, 0]);
    archive
}

/// A force curve of JPK as the readers afmformats and jpkfile describe it: properties that segments
/// share, shorts for the deflection, integers for the height.
fn jpk() -> Vec<u8> {
    let shared = "#shared\n\
        lcd-info.0.encoder.type=signedshort\n\
        lcd-info.0.encoder.scaling.offset=0.5\n\
        lcd-info.0.encoder.scaling.multiplier=1.0E-3\n\
        lcd-info.0.encoder.scaling.unit.unit=V\n\
        lcd-info.0.conversion-set.conversions.base=volts\n\
        lcd-info.0.conversion-set.conversions.default=force\n\
        lcd-info.0.conversion-set.conversion.distance.base-calibration-slot=volts\n\
        lcd-info.0.conversion-set.conversion.distance.scaling.offset=0.0\n\
        lcd-info.0.conversion-set.conversion.distance.scaling.multiplier=7.0E-8\n\
        lcd-info.0.conversion-set.conversion.distance.scaling.unit.unit=m\n\
        lcd-info.0.conversion-set.conversion.force.base-calibration-slot=distance\n\
        lcd-info.0.conversion-set.conversion.force.scaling.offset=0.0\n\
        lcd-info.0.conversion-set.conversion.force.scaling.multiplier=0.043\n\
        lcd-info.0.conversion-set.conversion.force.scaling.unit.unit=N\n\
        lcd-info.1.encoder.type=signedinteger\n\
        lcd-info.1.encoder.scaling.offset=0.0\n\
        lcd-info.1.encoder.scaling.multiplier=1.0E-9\n\
        lcd-info.1.encoder.scaling.unit.unit=V\n\
        lcd-info.1.conversion-set.conversions.base=volts\n\
        lcd-info.1.conversion-set.conversions.default=nominal\n\
        lcd-info.1.conversion-set.conversion.nominal.base-calibration-slot=volts\n\
        lcd-info.1.conversion-set.conversion.nominal.scaling.offset=1.0E-6\n\
        lcd-info.1.conversion-set.conversion.nominal.scaling.multiplier=-2.0E-6\n\
        lcd-info.1.conversion-set.conversion.nominal.scaling.unit.unit=m\n\
        force-segment-header-info.0.settings.segment-settings.style=extend\n\
        force-segment-header-info.1.settings.segment-settings.style=retract\n";
    let mut files = vec![
        (
            "header.properties".to_owned(),
            b"jpk-data-file=jpk-force\n".to_vec(),
        ),
        (
            "shared-data/header.properties".to_owned(),
            shared.as_bytes().to_vec(),
        ),
    ];
    for segment in 0..2_i32 {
        let folder = format!("segments/{segment}/");
        let header = format!(
            "force-segment-header.force-segment-header-info.*={segment}\n\
             channel.vDeflection.lcd-info.*=0\nchannel.measuredHeight.lcd-info.*=1\n"
        );
        files.push((
            format!("{folder}segment-header.properties"),
            header.into_bytes(),
        ));
        let shorts = [0_i16, -500, 1500 + segment as i16];
        let shorts = shorts.iter().flat_map(|of| of.to_be_bytes());
        files.push((
            format!("{folder}channels/vDeflection.dat"),
            shorts.collect(),
        ));
        let heights = [0_i32, 100_000_000, 200_000_000 + segment];
        let heights = heights.iter().flat_map(|of| of.to_be_bytes());
        files.push((
            format!("{folder}channels/measuredHeight.dat"),
            heights.collect(),
        ));
    }
    zip(&files)
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

/// A spectroscopy of Nanosurf as its reader NSFopen describes it: two channels there and back, 16
/// bits.
fn nid() -> Vec<u8> {
    let mut text = String::from("[DataSet]\r\nGroupCount=1\r\nGr0-Name=Spec\r\nGr0-Count=4\r\n");
    let channels = [
        ("Spec forward", "Z-Axis", "m"),
        ("Spec forward", "Deflection", "V"),
        ("Spec backward", "Z-Axis", "m"),
        ("Spec backward", "Deflection", "V"),
    ];
    for k in 0..4 {
        let _ = write!(text, "Gr0-Ch{k}=DataSet-0:{k}\r\n");
    }
    for (k, (frame, name, unit)) in channels.iter().enumerate() {
        let range = if *unit == "m" { "2.0E-6" } else { "20" };
        let _ = write!(
            text,
            "\r\n[DataSet-0:{k}]\r\nFrame={frame}\r\nPoints=3\r\nLines=1\r\nSaveBits=16\r\n\
             Dim0Min=0\r\nDim0Range=1E-6\r\nDim0Unit=m\r\n\
             Dim2Name={name}\r\nDim2Min=0\r\nDim2Range={range}\r\nDim2Unit={unit}\r\n"
        );
    }
    text +=
        "\r\n[DataSet\\Calibration\\Cantilever]\r\nName=X\r\nPropCount=1\r\nProp0=D[0.2]*[N/m]\r\n";
    text += "\r\n[DataSet\\Calibration\\Scanhead]\r\nIn5=0,1,2,3,1E-6,5\r\n\r\n#!";
    let mut file = text.into_bytes();
    for raw in [
        -32768_i16, 0, 16384, 0, 0, 8192, 16384, 0, -32768, 8192, 0, 0,
    ] {
        file.extend(raw.to_le_bytes());
    }
    file
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
