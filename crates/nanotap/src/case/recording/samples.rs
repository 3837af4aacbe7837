//! Files made here in the instruments' formats, intact and hostile; the program's tests use them too.

use std::fmt::Write as _;

/// An Igor binary wave of version 5 (WaveMetrics, Technical Note 003: `BinHeader5` of 64 bytes,
/// `WaveHeader5` of 320, data, note, labels).
pub(crate) fn ibw() -> Vec<u8> {
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

/// A file for an archive.
pub(crate) struct Packed {
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
    /// Whether it is deflated, or stored.
    pub(crate) deflated: bool,
    /// Length that the archive states.
    pub(crate) stated: usize,
    /// Where the directory says that it is, if it has no separate bytes.
    pub(crate) at: Option<usize>,
}

impl Packed {
    pub(crate) fn new(name: &str, bytes: Vec<u8>, deflated: bool) -> Self {
        Self {
            name: name.to_owned(),
            stated: bytes.len(),
            bytes,
            deflated,
            at: None,
        }
    }
}

/// A zip archive (PKWARE, APPNOTE 6.3.10): local headers, central directory, end record.
pub(crate) fn zip(files: &[Packed]) -> Vec<u8> {
    let mut archive = Vec::new();
    let mut directory = Vec::new();
    for file in files {
        let packed = if file.deflated {
            miniz_oxide::deflate::compress_to_vec(&file.bytes, 6)
        } else {
            file.bytes.clone()
        };
        let mut common = Vec::new();
        common.extend([20, 0, 0, 0]);
        common.extend(if file.deflated { [8, 0] } else { [0, 0] });
        // Time and checksum, which are not read.
        common.extend([0; 8]);
        common.extend((packed.len() as u32).to_le_bytes());
        common.extend((file.stated as u32).to_le_bytes());
        common.extend((file.name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        let at = file.at.unwrap_or(archive.len());
        if file.at.is_none() {
            archive.extend(b"PK\x03\x04");
            archive.extend(&common);
            archive.extend(file.name.as_bytes());
            archive.extend(&packed);
        }
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend((at as u32).to_le_bytes());
        directory.extend(file.name.as_bytes());
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
/// share, shorts for the deflection, integers for the height. Files of odd places are deflated.
pub(crate) fn jpk() -> Vec<u8> {
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
    let packed = files
        .into_iter()
        .enumerate()
        .map(|(k, (name, bytes))| Packed::new(&name, bytes, k % 2 == 1));
    zip(&packed.collect::<Vec<_>>())
}

/// A spectroscopy of Nanosurf as its reader NSFopen describes it: two channels there and back, 16
/// bits.
pub(crate) fn nid() -> Vec<u8> {
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

/// Archives that would take much more memory or time than their length suggests, by name.
pub(crate) fn bombs() -> Vec<(&'static str, Vec<u8>)> {
    let shared = "shared-data/header.properties";
    let segment = "segments/0/segment-header.properties";
    let encoder = "lcd-info.0.encoder.type=signedshort\n\
        lcd-info.0.encoder.scaling.offset=0.5\n\
        lcd-info.0.encoder.scaling.multiplier=1.0E-3\n\
        lcd-info.0.encoder.scaling.unit.unit=V\n\
        lcd-info.0.conversion-set.conversions.base=volts\n\
        lcd-info.0.conversion-set.conversions.default=volts\n";
    let head = |channels: &[String]| {
        let line = |channel: &String| format!("channel.{channel}.lcd-info.*=0\n");
        let lines: String = channels.iter().map(line).collect();
        format!("force-segment-header.settings.style=extend\n{lines}").into_bytes()
    };
    let text = |name: &str, bytes: Vec<u8>| Packed::new(name, bytes, true);
    let lines = |line: &dyn Fn(usize) -> String| -> Vec<u8> {
        (0..20_000).flat_map(|k| line(k).into_bytes()).collect()
    };
    let file = |channel: &str| format!("segments/0/channels/{channel}.dat");
    // 20,000 references to 20,000 properties.
    let mut referring = head(&[]);
    referring.extend(lines(&|k| format!("p{k}.a.*=0\n")));
    let product = vec![
        text(shared, lines(&|k| format!("a.0.k{k}=1\n"))),
        text(segment, referring),
    ];
    // One name 6000 times, after a channel of 20 MiB.
    let one = vec!["x".to_owned()];
    let mut repeated = vec![
        text(shared, encoder.into()),
        text(segment, head(&one)),
        text(&file("x"), vec![1; 20 << 20]),
    ];
    repeated.extend((0..6000).map(|_| Packed::new(&file("x"), Vec::new(), false)));
    // 100 channels at the place of one, said to be empty.
    let many: Vec<String> = (0..100).map(|k| format!("c{k}")).collect();
    let start = || vec![text(shared, encoder.into()), text(segment, head(&many))];
    let mut misplaced = start();
    let place = zip(&misplaced).len();
    let place = place - directory_length(&misplaced);
    misplaced.push(Packed::new(&file("c0"), vec![1; 64 << 10], false));
    misplaced.extend(many[1..].iter().map(|channel| Packed {
        at: Some(place),
        stated: 0,
        ..Packed::new(&file(channel), vec![1; 64 << 10], false)
    }));
    // A stored channel that states to be empty.
    let mut unequal = start();
    unequal.push(Packed {
        stated: 0,
        ..Packed::new(&file("c0"), vec![1; 64 << 10], false)
    });
    // A channel within the bytes of another one.
    let inner = Packed::new(&file("c1"), vec![1; 1000], true);
    let mut nested = start();
    let outer = zip(&[Packed::new(&inner.name, inner.bytes.clone(), true)]);
    nested.push(Packed::new(&file("c0"), outer, false));
    let header = 30 + file("c0").len();
    nested.push(Packed {
        at: Some(place + header),
        ..inner
    });
    // A channel of 100 MiB in 100 KiB.
    let long = vec![
        text(shared, encoder.into()),
        text(segment, head(&one)),
        text(&file("x"), vec![0; 100 << 20]),
    ];
    // 30 channels of a million rows.
    let wide: Vec<Packed> = [text(shared, encoder.into()), text(segment, head(&many))]
        .into_iter()
        .chain(
            many[..30]
                .iter()
                .map(|channel| text(&file(channel), vec![0; 2_000_000])),
        )
        .collect();
    // Properties of 100 MiB.
    let heading = vec![text(shared, b"a=\n".repeat(25 << 20))];
    vec![
        ("product", zip(&product)),
        ("repeated", zip(&repeated)),
        ("misplaced", zip(&misplaced)),
        ("unequal", zip(&unequal)),
        ("nested", zip(&nested)),
        ("long", zip(&long)),
        ("wide", zip(&wide)),
        ("heading", zip(&heading)),
    ]
}

/// Length of the directory and the last record of an archive of these files.
fn directory_length(files: &[Packed]) -> usize {
    files.iter().map(|file| 46 + file.name.len()).sum::<usize>() + 22
}
