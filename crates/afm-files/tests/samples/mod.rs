//! Small files of every format, written here: for the tests of the readers and for hostile changes.
#![allow(dead_code, reason = "each test uses some of the writers")]

use std::borrow::Cow;
use std::io::Write;

/// A zip archive; every second file is deflated.
pub(crate) fn zip(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut archive = Vec::new();
    let files = files.iter().enumerate();
    let files = files.map(|(k, (name, content))| (name.clone(), &content[..], k % 2 == 1));
    zip_into(&mut archive, files).expect("memory");
    archive
}

/// Writes a zip archive of files: name, content, and whether it is deflated. Without zip64: of more than
/// 65,535 files the last 16 bits of the count are written, as older programs do.
pub(crate) fn zip_into<'a>(
    archive: &mut impl Write,
    files: impl Iterator<Item = (String, &'a [u8], bool)>,
) -> std::io::Result<()> {
    let mut directory = Vec::new();
    let (mut at, mut count) = (0_u32, 0_u16);
    for (name, content, is_deflated) in files {
        let (method, packed) = if is_deflated {
            let packed = miniz_oxide::deflate::compress_to_vec(content, 6);
            (8_u16, Cow::Owned(packed))
        } else {
            (0, Cow::Borrowed(content))
        };
        let mut shared = Vec::new();
        shared.extend([20, 0, 0, 0]);
        shared.extend(method.to_le_bytes());
        shared.extend([0; 4]);
        shared.extend(crc32fast::hash(content).to_le_bytes());
        shared.extend((packed.len() as u32).to_le_bytes());
        shared.extend((content.len() as u32).to_le_bytes());
        shared.extend((name.len() as u16).to_le_bytes());
        shared.extend([0; 2]);
        archive.write_all(b"PK\x03\x04")?;
        archive.write_all(&shared)?;
        archive.write_all(name.as_bytes())?;
        archive.write_all(&packed)?;
        directory.extend(b"PK\x01\x02\x14\0");
        directory.extend(&shared);
        directory.extend([0; 10]);
        directory.extend(at.to_le_bytes());
        directory.extend(name.as_bytes());
        at += 4 + (shared.len() + name.len() + packed.len()) as u32;
        count = count.wrapping_add(1);
    }
    archive.write_all(&directory)?;
    archive.write_all(b"PK\x05\x06\0\0\0\0")?;
    archive.write_all(&count.to_le_bytes())?;
    archive.write_all(&count.to_le_bytes())?;
    archive.write_all(&(directory.len() as u32).to_le_bytes())?;
    archive.write_all(&at.to_le_bytes())?;
    archive.write_all(&[0; 2])
}

const SHARED: &str = "\
lcd-info.0.encoder.type=signedshort
lcd-info.0.encoder.scaling.multiplier=0.001
lcd-info.0.encoder.scaling.offset=0.5
lcd-info.0.encoder.scaling.unit.unit=V
lcd-info.0.conversion-set.conversions.list=distance force
lcd-info.0.conversion-set.conversions.default=force
lcd-info.0.conversion-set.conversions.base=volts
lcd-info.0.conversion-set.conversion.distance.defined=true
lcd-info.0.conversion-set.conversion.distance.base-calibration-slot=volts
lcd-info.0.conversion-set.conversion.distance.scaling.multiplier=5.0E-8
lcd-info.0.conversion-set.conversion.distance.scaling.unit.unit=m
lcd-info.0.conversion-set.conversion.force.base-calibration-slot=distance
lcd-info.0.conversion-set.conversion.force.scaling.multiplier=0.04
lcd-info.0.conversion-set.conversion.force.scaling.unit.unit=N
lcd-info.1.encoder.type=signedinteger
lcd-info.1.encoder.scaling.multiplier=1.0E-9
lcd-info.1.encoder.scaling.unit.unit=m
lcd-info.1.conversion-set.conversions.list=nominal calibrated
lcd-info.1.conversion-set.conversions.base=absolute
lcd-info.1.conversion-set.conversion.nominal.base-calibration-slot=absolute
lcd-info.1.conversion-set.conversion.nominal.scaling.multiplier=2.0
lcd-info.1.conversion-set.conversion.nominal.scaling.unit.unit=m
lcd-info.1.conversion-set.conversion.calibrated.base-calibration-slot=nominal
lcd-info.1.conversion-set.conversion.calibrated.scaling.multiplier=1.5
lcd-info.1.conversion-set.conversion.calibrated.scaling.unit.unit=m
";

/// Files of a JPK curve: approach, pause without the commanded height, retract.
fn jpk_segments(prefix: &str) -> Files {
    let mut files = Vec::new();
    for (segment, style) in ["extend", "pause", "retract"].into_iter().enumerate() {
        let folder = format!("{prefix}segments/{segment}/");
        let header = format!(
            "#comment\nforce-segment-header.num-points=4\nforce-segment-header.duration=0.5\n\
             force-segment-header.settings.segment-settings.style={style}\n\
             force-segment-header.settings.segment-settings.num-points=5\n\
             channels.list=vDeflection measuredHeight height time\n\
             channel.vDeflection.lcd-info.*=0\nchannel.measuredHeight.lcd-info.*=1\nchannel.height.lcd-info.*=1\n"
        );
        files.push((
            format!("{folder}segment-header.properties"),
            header.into_bytes(),
        ));
        let deflection: Vec<u8> = [0_i16, 10, 20, 1000]
            .into_iter()
            .flat_map(i16::to_be_bytes)
            .collect();
        let mut heights = [4000_i32, 3000, 2000, 1000];
        if style == "retract" {
            heights.reverse();
        }
        let height: Vec<u8> = heights.into_iter().flat_map(i32::to_be_bytes).collect();
        files.push((format!("{folder}channels/vDeflection.dat"), deflection));
        files.push((
            format!("{folder}channels/measuredHeight.dat"),
            height.clone(),
        ));
        if style != "pause" {
            files.push((format!("{folder}channels/height.dat"), height));
        }
    }
    files
}

/// Files of a JPK map of two curves, numbers 0 and 3 of a grid of 2 × 2, with its image.
pub(crate) fn jpk_map() -> Files {
    let map = "spm-force-scan-map";
    let top = format!(
        "type=force-scan-map\n{map}.position-pattern.grid.ilength=2\n{map}.position-pattern.grid.jlength=2\n\
         {map}.position-pattern.grid.ulength=2.0E-6\n{map}.position-pattern.grid.vlength=2.0E-6\n\
         {map}.position-pattern.grid.xcenter=1.0E-5\n{map}.position-pattern.grid.ycenter=0.0\n\
         {map}.position-pattern.grid.theta=0.0\n{map}.position-pattern.back-and-forth=true\n{map}.start=16\\:29\n"
    );
    let mut files = vec![
        ("header.properties".to_owned(), top.into_bytes()),
        (
            "shared-data/header.properties".to_owned(),
            SHARED.as_bytes().to_vec(),
        ),
        ("data-image.force".to_owned(), jpk_image()),
    ];
    for (index, x) in [(3, "9.5E-6"), (0, "9.5E-6")] {
        let own = format!(
            "force-scan-series.header.position.x={x}\nforce-scan-series.header.position.y=5.0E-7\n\
             force-scan-series.header.position-index={index}\n"
        );
        files.push((format!("index/{index}/header.properties"), own.into_bytes()));
        files.extend(jpk_segments(&format!("index/{index}/")));
    }
    files
}

/// Files of a single JPK curve.
pub(crate) fn jpk_force() -> Files {
    let mut files = vec![
        (
            "header.properties".to_owned(),
            b"type=force-scan-series\n".to_vec(),
        ),
        (
            "shared-data/header.properties".to_owned(),
            SHARED.as_bytes().to_vec(),
        ),
    ];
    files.extend(jpk_segments(""));
    files
}

/// A JPK image of 2 × 2 points after its thumbnail.
pub(crate) fn jpk_image() -> Vec<u8> {
    let mut file = b"MM\0*\0\0\0\0".to_vec();
    let double = |file: &mut Vec<u8>, value: f64| {
        file.extend(value.to_be_bytes());
        file.len() as u32 - 8
    };
    let text = |file: &mut Vec<u8>, value: &str| {
        file.extend(value.as_bytes());
        file.push(0);
        (
            file.len() as u32 - value.len() as u32 - 1,
            value.len() as u32 + 1,
        )
    };
    let (width, height) = (double(&mut file, 2e-6), double(&mut file, 4e-6));
    let (multiplier, offset) = (double(&mut file, 1e-9), double(&mut file, 5e-9));
    let name = text(&mut file, "height");
    let properties = text(&mut file, "retrace : true");
    let slot = text(&mut file, "nominal");
    let scaling = text(&mut file, "LinearScaling");
    let strip = file.len() as u32;
    file.extend([1_i32, 2, 3, -4].into_iter().flat_map(i32::to_be_bytes));
    let directories: [Vec<(u16, u16, u32, u32)>; 2] = [
        vec![(0x8042, 12, 1, width), (0x8043, 12, 1, height)],
        vec![
            (256, 4, 1, 2),
            (257, 4, 1, 2),
            (258, 4, 1, 32),
            (262, 4, 1, 1),
            (273, 4, 1, strip),
            (279, 4, 1, 16),
            (339, 4, 1, 2),
            (0x8050, 2, name.1, name.0),
            (0x8053, 2, properties.1, properties.0),
            (0x8080, 4, 1, 1),
            (0x8081, 2, slot.1, slot.0),
            (0x8090, 2, slot.1, slot.0),
            // Short values are in the directory itself.
            (0x80A2, 2, 2, u32::from_be_bytes(*b"m\0\0\0")),
            (0x80A3, 2, scaling.1, scaling.0),
            (0x80A4, 12, 1, multiplier),
            (0x80A5, 12, 1, offset),
        ],
    ];
    let mut link = 4;
    for directory in directories {
        let at = file.len() as u32;
        file[link..link + 4].copy_from_slice(&at.to_be_bytes());
        file.extend((directory.len() as u16).to_be_bytes());
        for (tag, kind, count, value) in directory {
            file.extend(tag.to_be_bytes());
            file.extend(kind.to_be_bytes());
            file.extend(count.to_be_bytes());
            file.extend(value.to_be_bytes());
        }
        link = file.len();
        file.extend([0; 4]);
    }
    file
}

/// A Nanosurf file: a map of two curves of 3 and 2 points, an image and a spectrum.
pub(crate) fn nanosurf() -> Vec<u8> {
    let channel = |section: &str,
                   name: &str,
                   unit: &str,
                   range: &str,
                   points: usize,
                   lines: usize,
                   more: &str| {
        format!(
            "[{section}]\nPoints={points}\nLines={lines}\nSaveBits=16\nSaveSign=Signed\nSaveOrder=Intel\n\
             Dim2Name={name}\nDim2Unit={unit}\nDim2Range={range}\nDim2Min=0\n{more}\n"
        )
    };
    let axis = "Dim0Name=Z-Axis\nDim0Unit=m\nDim0Min=0\nDim0Range=2e-6\nLineDim1Points=2\nLineDim1Min=1e-6\nLineDim1Range=1e-6";
    let image = "Dim0Name=X*\nDim0Unit=m\nDim0Range=1e-6\nDim0Min=0\nDim1Unit=m\nDim1Range=2e-6";
    let mut header = String::from(
        "[DataSet]\nGroupCount=5\nGr0-Name=Spec forward\nGr0-Count=2\nGr0-Ch0=DataSet-0:0\nGr0-Ch1=DataSet-0:1\n\
         Gr1-Name=Spec backward\nGr1-Count=1\nGr1-Ch0=DataSet-1:0\nGr2-Name=Scan forward\nGr2-Count=1\n\
         Gr2-Ch0=DataSet-2:0\nGr3-Name=Spectrum FFT\nGr3-Count=1\nGr3-Ch0=DataSet-3:0\n\
         Gr4-Name=Spec fwd pause\nGr4-Count=1\nGr4-Ch0=DataSet-4:0\n\
         [DataSet\\Calibration\\Cantilever]\nProp0=D[2.0]*[N/m]\n[DataSet\\Calibration\\Scanhead]\n\
         In5=5,TipSignalDC,Deflection,m,5e-7,0\n[DataSet\\Parameters\\Spectroscopy]\nFwModTime=D[0.25]*[s]\nFwPauseTime=D[0.1]*[s]\n\
         [DataSet\\SpecInfos\\SpecMapTable]\nMap0=0;1e-6;0;0;2;1;0;1\n",
    );
    header += &channel("DataSet-0:0", "Deflection", "N", "65536e-9", 3, 2, axis);
    header += &channel("DataSet-0:1", "Z-Axis Sensor", "m", "65536e-9", 3, 2, axis);
    header += &channel("DataSet-1:0", "Deflection", "N", "65536e-9", 3, 2, axis);
    header += &channel("DataSet-2:0", "Topography", "nm", "65536", 2, 2, image);
    header += &channel(
        "DataSet-3:0",
        "Amplitude",
        "m/sqrt(Hz)",
        "65536",
        3,
        1,
        "Dim0Unit=Hz\nDim0Min=0\nDim0Range=200",
    );
    header += &channel(
        "DataSet-4:0",
        "Deflection",
        "N",
        "65536e-9",
        2,
        2,
        "Dim0Name=Time\nDim0Unit=s\nDim0Min=0\nDim0Range=0.1",
    );
    let mut file = header.into_bytes();
    file.extend(b"#!");
    let numbers: [&[i16]; 6] = [
        &[0, 1, 2, 10, 11, 0],
        &[5, 6, 7, 8, 9, 0],
        &[3, 2, 1, 12, 13, 0],
        &[1, 2, 3, 4],
        &[7, 8, 9],
        &[2, 4, 11, 11],
    ];
    for number in numbers.into_iter().flatten() {
        // −2¹⁵ stands for the least value.
        file.extend((number - i16::MAX - 1).to_le_bytes());
    }
    file
}

/// An Igor wave of these numbers, with names along its last dimension.
fn igor(shape: &[usize], numbers: &[f32], names: &[&str], note: &str) -> Vec<u8> {
    let mut file = vec![0; 384];
    let mut put = |at: usize, bytes: &[u8]| file[at..at + bytes.len()].copy_from_slice(bytes);
    let whole = |of: usize| (of as i32).to_le_bytes();
    put(0, &5_i16.to_le_bytes());
    put(4, &whole(320 + 4 * numbers.len()));
    put(12, &whole(note.len()));
    put(36 + 4 * (shape.len() - 1), &whole(32 * (names.len() + 1)));
    put(76, &whole(numbers.len()));
    put(80, &2_i16.to_le_bytes());
    for (k, length) in shape.iter().enumerate() {
        put(132 + 4 * k, &whole(*length));
        put(148 + 8 * k, &0.5_f64.to_le_bytes());
    }
    let words = file
        .chunks_exact(2)
        .map(|two| u16::from_le_bytes([two[0], two[1]]));
    let sum = words.fold(0_u16, u16::wrapping_add);
    file[2..4].copy_from_slice(&sum.wrapping_neg().to_le_bytes());
    file.extend(numbers.iter().flat_map(|of| of.to_le_bytes()));
    file.extend(note.as_bytes());
    for name in std::iter::once(&"").chain(names) {
        let mut label = [0; 32];
        label[..name.len()].copy_from_slice(name.as_bytes());
        file.extend(label);
    }
    file
}

/// A curve of Asylum Research: approach of 3 points, retract of 2.
pub(crate) fn igor_curve() -> Vec<u8> {
    let numbers = [
        0.0, 1.0, 2.0, 2.0, 1.0, 0.1, 0.2, 0.3, 0.3, 0.2, 0.0, 1.5, 2.5, 2.5, 1.5,
    ];
    let note = "SpringConstant: 2\rInvOLS: 5e-08\rIndexes: 0,2,4,\rDirection: NaN,1,-1,\rXLVDT: 1e-6\rYLVDT: 2e-6\r";
    igor(&[5, 3], &numbers, &["Raw", "Defl", "ZSnsr"], note)
}

/// A spectrum of Asylum Research from 100 Hz on in steps of 0.5 Hz, in V²/Hz: a unit of six letters, which
/// stands behind the note.
pub(crate) fn igor_spectrum() -> Vec<u8> {
    let mut file = igor(&[3], &[1.0, 2.0, 3.0], &[], "Temp: 25\r");
    let unit = b"V^2/Hz";
    let note = 384 + 12 + "Temp: 25\r".len();
    file.splice(note..note, unit.iter().copied());
    let mut put = |at: usize, bytes: &[u8]| file[at..at + bytes.len()].copy_from_slice(bytes);
    put(16, &(unit.len() as i32).to_le_bytes());
    put(92, b"ThermalPSD");
    put(180, &100_f64.to_le_bytes());
    put(216, b"Hz");
    put(2, &[0, 0]);
    let words = file[..384]
        .chunks_exact(2)
        .map(|two| u16::from_le_bytes([two[0], two[1]]));
    let sum = words.fold(0_u16, u16::wrapping_add);
    file[2..4].copy_from_slice(&sum.wrapping_neg().to_le_bytes());
    file
}

/// An image of Asylum Research.
pub(crate) fn igor_image() -> Vec<u8> {
    let numbers = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
    igor(
        &[2, 2, 2],
        &numbers,
        &["HeightTrace", "PhaseTrace"],
        "ScanSize: 1\r",
    )
}

/// A header of Bruker with these lists, then numbers from byte 4096 on.
fn bruker(kind: &str, mode: &str, lists: &str, numbers: &[u8]) -> Vec<u8> {
    let header = format!(
        "\\*{kind}\r\n\\Version: 0x09200000\r\n\\Start context: FOL\r\n\\*Scanner list\r\n\\@Sens. Zsens: V 10.00000 nm/V\r\n\
         \\*Ciao scan list\r\n\\Operating mode: {mode}\r\n\\Scan Size: 1000 nm\r\n\\X Offset: -100 nm\r\n\\Y Offset: 50 nm\r\n\
         \\@Sens. DeflSens: V 50.00000 nm/V\r\n\\*Ciao force list\r\n\\Scan rate: 1\r\n\\Forward vel.: 20\r\n\\Hold Samples: 0\r\n\
         \\@4:Trig Threshold Deflection: V [Sens. DeflSens] (0.001000000 V/LSB) 0.02 V\r\n{lists}\\*File list end\r\n\x1a"
    );
    let mut file = header.into_bytes();
    file.resize(4096, 0);
    file.extend(numbers);
    file
}

/// A curve of Bruker of 3 points each way, 16 bits.
pub(crate) fn bruker_curve() -> Vec<u8> {
    let lists = "\\*Ciao force image list\r\n\\Data offset: 4096\r\n\\Data length: 12\r\n\\Bytes/pixel: 2\r\n\\Samps/line: 3 3\r\n\
         \\Spring Constant: 0.2\r\n\\@4:Image Data: S [DeflectionError] \"Deflection Error\"\r\n\
         \\@4:Z scale: V [Sens. DeflSens] (0.001000000 V/LSB) 2.5 V\r\n\\@4:Ramp size: V [Sens. Zsens] (0.006 V/LSB) 30.0 V\r\n";
    let numbers = [20_i16, 10, 0, 30, 5, -5];
    let bytes: Vec<u8> = numbers.into_iter().flat_map(i16::to_le_bytes).collect();
    bruker("Force file list", "Force", lists, &bytes)
}

/// A force volume of Bruker 9.2 of 2 × 1 curves of 2 points each way, with its image.
pub(crate) fn bruker_volume() -> Vec<u8> {
    let lists = "\\*Ciao force image list\r\n\\Data offset: 4096\r\n\\Data length: 32\r\n\\Bytes/pixel: 2\r\n\\Samps/line: 2 2\r\n\
         \\@4:Image Data: S [DeflectionError] \"Deflection Error\"\r\n\
         \\@4:Z scale: V [Sens. DeflSens] (0.001000000 V/LSB) 2.5 V\r\n\\@4:Ramp Size: V [Sens. Zsens] (0.006 V/LSB) 30.0 V\r\n\
         \\*Ciao image list\r\n\\Data offset: 4128\r\n\\Data length: 8\r\n\\Bytes/pixel: 2\r\n\\Samps/line: 2\r\n\\Number of lines: 1\r\n\
         \\@2:Image Data: S [Height] \"Height\"\r\n\\@2:Z scale: V [Sens. Zsens] (0.006 V/LSB) 65.536 V\r\n";
    let numbers = [20 * 256, 0, 20 * 256, 0, 300 * 256, 256, 2560, 0, 100, 200];
    let bytes: Vec<u8> = numbers.into_iter().flat_map(i32::to_le_bytes).collect();
    bruker("Force file list", "Force Volume", lists, &bytes)
}

/// A Gwyddion file with one field of 2 × 2 points.
pub(crate) fn gwyddion() -> Vec<u8> {
    fn named(name: &str, letter: u8, value: &[u8]) -> Vec<u8> {
        [name.as_bytes(), &[0, letter], value].concat()
    }
    fn object(kind: &str, components: &[Vec<u8>]) -> Vec<u8> {
        let content = components.concat();
        let size = (content.len() as u32).to_le_bytes();
        [kind.as_bytes(), &[0], &size, &content].concat()
    }
    let unit = |of: &str| {
        object(
            "GwySIUnit",
            &[named("unitstr", b's', format!("{of}\0").as_bytes())],
        )
    };
    let numbers: Vec<u8> = [1.0_f64, 2.0, 3.0, 4.0]
        .into_iter()
        .flat_map(f64::to_le_bytes)
        .collect();
    let data = [&4_u32.to_le_bytes()[..], &numbers].concat();
    let field = object(
        "GwyDataField",
        &[
            named("xres", b'i', &2_i32.to_le_bytes()),
            named("yres", b'i', &2_i32.to_le_bytes()),
            named("xreal", b'd', &1e-6_f64.to_le_bytes()),
            named("yreal", b'd', &2e-6_f64.to_le_bytes()),
            named("si_unit_xy", b'o', &unit("m")),
            named("si_unit_z", b'o', &unit("V")),
            named("data", b'D', &data),
        ],
    );
    let meta = object("GwyContainer", &[named("Speed", b's', b"1 Hz\0")]);
    let top = object(
        "GwyContainer",
        &[
            named("/0/data", b'o', &field),
            named("/0/data/title", b's', b"Potential\0"),
            named("/0/meta", b'o', &meta),
        ],
    );
    [b"GWYP", &top[..]].concat()
}

/// A Gwyddion simple field of 2 × 1 points.
pub(crate) fn gsf() -> Vec<u8> {
    let header = "Gwyddion Simple Field 1.0\nXRes = 2\nYRes = 1\nXReal = 1e-6\nYReal = 5e-7\nXYUnits = m\nZUnits = m\nTitle = Height\n";
    let mut file = header.as_bytes().to_vec();
    file.resize(file.len() / 4 * 4 + 4, 0);
    file.extend([1.5_f32, -2.0].into_iter().flat_map(f32::to_le_bytes));
    file
}

/// A curve of AFM Workshop whose retract is shorter.
pub(crate) fn workshop(point: usize) -> Vec<u8> {
    let x = point as f64 - 5.5;
    format!(
        "Force-Distance Curve\r\nFile Format:\t3\r\n\r\nPoint:\t{point}\r\nX, um:\t{x}\r\nY, um:\t2.5\r\nLight Lever Gain, mV/nm:\t20\r\n\
         Force Constant, nN/nm:\t0.5\r\n\r\nExtend Z-Sense(nm),Extend T-B(V),Retract Z-Sense(nm),Retract T-B(V)\r\n\
         100,0.1,102,0.3\r\n101,0.2,101,0.2\r\n102,0.3,,\r\n"
    )
    .into_bytes()
}

pub(crate) fn ntmdt() -> Vec<u8> {
    b"-3,0\t1,5\t1,4\r\n-2,0\t1,5\t1,4\r\n-1,0\t0,5\t0,4\r\n0,0\t0,25\t0,125\r\n".to_vec()
}

pub(crate) fn chiaro() -> Vec<u8> {
    b"Date\t01/02/2023\tTime\t10:00\r\nDevice:\tChiaro\r\nk (N/m)\t0.5\r\nTip radius (\xB5m)\t3\r\nX-position (um)\t10\r\nY-position (um)\t20\r\n\
      \r\nTime (s)\tLoad (uN)\tIndentation (nm)\tCantilever (nm)\tPiezo (nm)\tAuxiliary\r\n\
      0.0\t0.1\t0\t1\t100\r\n0.1\t0.2\t5\t2\t200\r\n0.2\t0.1\t0\t1\t100\r\n"
        .to_vec()
}

pub(crate) fn thermal() -> Vec<u8> {
    "# thermal noise data\n# sensitivity: 11.0 nm/V\n# Channels: 'Frequency' 'Vertical Deflection' 'fit-data' \n\
     # Units: 'Hz' 'V²/Hz' 'V²/Hz'\n\n0.0 1.0E-3 2.0E-3\n12.5 1.5E-3 2.5E-3\n"
        .as_bytes()
        .to_vec()
}

pub(crate) fn uff() -> Vec<u8> {
    b"HE UFF_code: 0\nHE Cantilever_springK_used(N/m): 0.5\nHE Recording_inv_optical_lever_sens_used(m/V): 1E-8\n\
      HE Recording_number_segment: 2\nHE Recording_segment_0_type: Approach\nHE Recording_segment_0_code: AP\n\
      HE Recording_segment_0_nb_col: 2\nHE Recording_segment_0_col_0_title: Displacement\nHE Recording_segment_0_col_0_unit: m\n\
      HE Recording_segment_0_col_1_title: Deflection\nHE Recording_segment_0_col_1_unit: volt\n\
      HE Recording_segment_1_type: Retract\nHE Recording_segment_1_code: RE\nHE Recording_segment_1_nb_col: 2\n\
      AP 0 0.0 3.0\nAP 0 1E-6 1.0\nRE 1 0.0 3.0\nRE 1 1E-6 0.5\n"
        .to_vec()
}

pub(crate) fn wsxm() -> Vec<u8> {
    let header = |length: usize| {
        format!(
            "WSxM file copyright WSxM solutions\r\nSxM Image file\r\nImage header size: {length:4}\r\n\r\n[Control]\r\n\r\n    X Amplitude: 1 µm\r\n\
             Y Amplitude: 500 nm\r\n[General Info]\r\nAcquisition channel: Topography\r\nNumber of columns: 2\r\nNumber of rows: 2\r\n\
             Z Amplitude: 6 nm\r\n[Header end]\r\n"
        )
    };
    let mut file = header(header(0).len()).into_bytes();
    file.extend([1_i16, 2, 3, 4].into_iter().flat_map(i16::to_le_bytes));
    file
}

/// An Asylum .ardf with a map of two curves and an image.
pub(crate) fn ardf() -> Vec<u8> {
    let record = |letters: &str, content: &[u8]| {
        let size = (content.len() as u32 + 16).to_le_bytes();
        let rest = [&size, letters.as_bytes(), &[0; 4], content].concat();
        [&crc32fast::hash(&rest).to_le_bytes()[..], &rest].concat()
    };
    let words = |of: &[u32]| {
        of.iter()
            .flat_map(|of| of.to_le_bytes())
            .collect::<Vec<u8>>()
    };
    let floats = |of: &[f32]| {
        of.iter()
            .flat_map(|of| of.to_le_bytes())
            .collect::<Vec<u8>>()
    };
    let name = |of: &str| {
        let mut name = of.as_bytes().to_vec();
        name.resize(32, 0);
        name
    };
    let mut file = record("ARDF", &[]);
    file.extend([0; 8]);
    file.extend(record(
        "TEXT",
        b"SpringConstant: 2\rInvOLS: 1e-7\rFastScanSize: 2e-6\rSlowScanSize: 1e-6\r",
    ));
    file.extend(record("IDEF", &[words(&[2, 1]), name("Height")].concat()));
    file.extend(record("IDAT", &floats(&[1.0, 2.0])));
    file.extend(record(
        "VDEF",
        &[words(&[2, 1]), b"Ext;Ret;\0".to_vec()].concat(),
    ));
    for (channel, unit) in [("Raw", "m"), ("Defl", "m")] {
        file.extend(record("VCHN", &[name(channel), name(unit)].concat()));
    }
    for point in 0..2 {
        for channel in 0..2 {
            let head = words(&[point, 0, point, 4, channel, 0, 2, 4, 4, 4]);
            let numbers = [0.0, 1.0, 1.0, 0.5].map(|of: f32| of + point as f32);
            file.extend(record("VDAT", &[head, floats(&numbers)].concat()));
        }
    }
    file
}

/// Every sample by its name, but those that are archives.
pub(crate) fn files() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("hdf5", hdf5()),
        ("hdf5 images", hdf5_images()),
        ("jpk image", jpk_image()),
        ("nanosurf", nanosurf()),
        ("igor curve", igor_curve()),
        ("igor image", igor_image()),
        ("igor spectrum", igor_spectrum()),
        ("bruker curve", bruker_curve()),
        ("bruker volume", bruker_volume()),
        ("gwyddion", gwyddion()),
        ("gsf", gsf()),
        ("workshop", workshop(1)),
        ("ntmdt", ntmdt()),
        ("chiaro", chiaro()),
        ("thermal", thermal()),
        ("uff", uff()),
        ("wsxm", wsxm()),
        ("ardf", ardf()),
    ]
}

/// Files by their names.
pub(crate) type Files = Vec<(String, Vec<u8>)>;

/// The archives among the samples.
pub(crate) fn archives() -> Vec<(&'static str, Files)> {
    let map = [2, 1].map(|point| (format!("{point}.csv"), workshop(point)));
    vec![
        ("jpk force", jpk_force()),
        ("jpk map", jpk_map()),
        ("workshop map", map.to_vec()),
    ]
}

/// A map of two curves that afmformats 0.18.7 and h5py 3.16 wrote, packed by zlib. The rows of the first
/// are as afmformats stores them; those of the second in chunks, as a whole, and in the header.
pub(crate) fn hdf5() -> Vec<u8> {
    unpacked(include_bytes!("afmformats.h5.zlib"))
}

/// Two frames of 3 × 2 pixels in the layout of JPK, which h5py 3.16 wrote in chunks of 4 × 1.
pub(crate) fn hdf5_images() -> Vec<u8> {
    unpacked(include_bytes!("images.h5-jpk.zlib"))
}

fn unpacked(packed: &[u8]) -> Vec<u8> {
    miniz_oxide::inflate::decompress_to_vec_zlib(packed).expect("a zlib stream")
}

/// The largest memory of this process so far, in bytes, where the system tells it.
#[expect(clippy::disallowed_methods, reason = "the system's own file ends")]
pub(crate) fn largest_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().strip_suffix(" kB")?.parse::<u64>().ok()?)
}
