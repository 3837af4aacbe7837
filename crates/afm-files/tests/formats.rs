//! Every format on small files that `samples` writes: what is read, in which order and unit.

mod samples;

use afm_files::{Curve, DistanceSource, Document, Error, Format, Limits, Style, read, read_from};

fn open(bytes: Vec<u8>) -> Document {
    read(bytes).unwrap_or_else(|error| panic!("{error}"))
}

fn curve(document: &Document, number: usize) -> Curve {
    document
        .curve(number)
        .unwrap_or_else(|error| panic!("{error}"))
}

fn styles(curve: &Curve) -> Vec<Style> {
    curve.segments.iter().map(|of| of.style).collect()
}

/// Values in units of `step`, rounded.
fn steps(values: &[f64], step: f64) -> Vec<i64> {
    values.iter().map(|of| (of / step).round() as i64).collect()
}

fn distance(curve: &Curve, segment: usize, step: f64) -> Vec<i64> {
    let found = curve.distance_in(&curve.segments[segment]);
    steps(&found.expect("a distance").values, step)
}

fn deflection(curve: &Curve, segment: usize, step: f64) -> Vec<i64> {
    let found = curve
        .deflection_in(&curve.segments[segment])
        .expect("a deflection");
    assert_eq!(found.unit, "m");
    steps(&found.values, step)
}

#[test]
fn a_jpk_curve_has_all_segments_and_the_measured_height() {
    let document = open(samples::zip(&samples::jpk_force()));
    assert_eq!(document.format, Format::Jpk);
    assert_eq!(document.kind, "force-scan-series");
    let curve = curve(&document, 0);
    assert_eq!(
        styles(&curve),
        [Style::Approach, Style::Pause, Style::Retract]
    );
    assert_eq!(
        (curve.spring_constant, curve.sensitivity),
        (Some(0.04), Some(5e-8))
    );
    let chosen = curve.distance.clone().expect("a distance");
    assert_eq!(
        (chosen.channel.as_str(), chosen.source),
        ("measuredHeight", DistanceSource::Measured)
    );
    assert!(!chosen.grows_toward_surface);
    assert_eq!(distance(&curve, 0, 1e-9), [8000, 6000, 4000, 2000]);
    assert_eq!(deflection(&curve, 0, 1e-11), [2500, 2550, 2600, 7500]);
    assert_eq!(curve.segments[0].duration, Some(0.5));
    assert_eq!(
        curve.segments[0]
            .channel("height")
            .map(|of| steps(&of.values, 1e-9)[0]),
        Some(12000)
    );
    assert!(
        curve
            .notes
            .iter()
            .any(|of| of.contains("has 4 of the 5 points")),
        "{:?}",
        curve.notes
    );
}

#[test]
fn a_jpk_map_has_its_grid_positions_and_image() {
    let document = open(samples::zip(&samples::jpk_map()));
    assert_eq!(document.curve_count(), 2);
    let grid = document.grid.expect("a grid");
    assert_eq!(grid.shape, [2, 2]);
    for (number, index) in [0, 3].into_iter().enumerate() {
        let curve = curve(&document, number);
        assert_eq!((curve.index, curve.pixel), (index, Some(index)));
        let [x, y] = curve.position.expect("a position");
        let [u, v] = grid.position(index).expect("a place of the grid");
        assert!(
            (x - u).abs() < 1e-15 && (y.abs() - v.abs()).abs() < 1e-15,
            "{x} {y} {u} {v}"
        );
    }
    // Pixel 3 of a grid that runs back and forth is the first of its second row.
    assert_eq!(document.number_at([0, 1]), Some(1));
    assert_eq!(document.number_at([0, 0]), Some(0));
    assert_eq!(document.number_at([1, 0]), None);
    assert_eq!(document.images[0].name, "height retrace");
    assert_eq!(
        document
            .settings
            .iter()
            .find(|(key, _)| key.ends_with("start"))
            .map(|of| of.1.as_str()),
        Some("16:29")
    );
    assert_eq!(
        document.curve(2),
        Err(Error::NoCurve {
            number: 2,
            count: 2
        })
    );
}

#[test]
fn a_reflected_grid_is_reported() {
    let mut files = samples::jpk_map();
    assert!(open(samples::zip(&files)).notes.is_empty());
    let line = b"spm-force-scan-map.position-pattern.grid.reflect=true\n";
    files[0].1.extend(line);
    let notes = open(samples::zip(&files)).notes;
    assert!(notes[0].contains("the grid is reflected"), "{notes:?}");
}

#[test]
fn a_jpk_image_is_scaled_and_its_lowest_line_is_the_last() {
    let document = open(samples::jpk_image());
    let image = &document.images[0];
    assert_eq!(
        (image.unit.as_str(), image.shape, image.size),
        ("m", [2, 2], Some([2e-6, 4e-6]))
    );
    assert_eq!(steps(&image.values, 1e-9), [8, 1, 6, 7]);
}

#[test]
fn a_nanosurf_map_has_each_line_with_its_own_length() {
    let document = open(samples::nanosurf());
    assert_eq!(document.curve_count(), 2);
    let first = curve(&document, 0);
    // The pause is the last group of the file.
    assert_eq!(
        styles(&first),
        [Style::Approach, Style::Pause, Style::Retract]
    );
    assert_eq!(
        (first.spring_constant, first.sensitivity),
        (Some(2.0), Some(5e-8))
    );
    assert_eq!(deflection(&first, 0, 0.5e-9), [0, 1, 2]);
    assert_eq!(deflection(&first, 1, 0.5e-9), [2, 4]);
    assert_eq!(first.segments[1].duration, Some(0.1));
    let time = first.segments[1].channel("Time").expect("a time");
    assert_eq!((time.unit.as_str(), &*time.values), ("s", &[0.0, 0.1][..]));
    // The way back lies along the axis in the file.
    assert_eq!(deflection(&first, 2, 0.5e-9), [1, 2, 3]);
    // The sensor has no way back: the axis is the distance of the whole curve.
    assert_eq!(
        first.distance.as_ref().map(|of| of.source),
        Some(DistanceSource::Commanded)
    );
    assert_eq!(distance(&first, 1, 1e-6), [2, 2]);
    assert_eq!(distance(&first, 2, 1e-6), [2, 1, 0]);
    let second = curve(&document, 1);
    assert_eq!(deflection(&second, 0, 0.5e-9), [10, 11]);
    assert_eq!(distance(&second, 0, 1e-6), [1, 2]);
    assert_eq!(second.segments[0].duration, Some(0.25));
    let [x, y] = second.position.expect("a position");
    assert!((x - 1e-6).abs() < 1e-18 && y == 0.0, "{x} {y}");
    assert_eq!(document.number_at([1, 0]), Some(1));
    assert_eq!(document.number_at([2, 0]), None);
    assert_eq!(steps(&document.images[0].values, 1e-9), [3, 4, 1, 2]);
    assert_eq!(document.images[0].size, Some([1e-6, 2e-6]));
    assert_eq!(document.spectra[0].frequency, [0.0, 100.0, 200.0]);
    assert_eq!(document.spectra[0].values, [7.0, 8.0, 9.0]);
}

#[test]
fn an_igor_curve_is_cut_at_its_indexes() {
    let document = open(samples::igor_curve());
    let curve = curve(&document, 0);
    assert_eq!(styles(&curve), [Style::Approach, Style::Retract]);
    assert_eq!(
        curve.distance.as_ref().map(|of| of.channel.as_str()),
        Some("ZSnsr")
    );
    assert_eq!(distance(&curve, 1, 0.5), [5, 3]);
    assert_eq!(deflection(&curve, 0, 0.1), [1, 2, 3]);
    assert_eq!(curve.segments[0].duration, Some(1.5));
    assert_eq!(curve.position, Some([1e-6, 2e-6]));
}

#[test]
fn an_igor_wave_over_frequency_is_a_spectrum() {
    let document = open(samples::igor_spectrum());
    let [spectrum] = &document.spectra[..] else {
        panic!("{:?}", document.spectra);
    };
    assert_eq!(spectrum.name, "ThermalPSD");
    assert_eq!(spectrum.unit, "V^2/Hz");
    assert_eq!(spectrum.frequency, [100.0, 100.5, 101.0]);
    assert_eq!(spectrum.values, [1.0, 2.0, 3.0]);
    assert_eq!(document.settings[0].1, "25");
}

#[test]
fn an_igor_image_has_its_lowest_line_last() {
    let document = open(samples::igor_image());
    assert_eq!(document.images.len(), 2);
    assert_eq!(document.images[0].values, [3.0, 4.0, 1.0, 2.0]);
    assert_eq!(
        (
            document.images[0].unit.as_str(),
            document.images[1].unit.as_str()
        ),
        ("m", "deg")
    );
    assert_eq!(document.images[0].size, Some([1.0, 1.0]));
}

#[test]
fn a_bruker_curve_is_in_the_order_of_time() {
    let document = open(samples::bruker_curve());
    let curve = curve(&document, 0);
    assert_eq!(deflection(&curve, 0, 50e-12), [0, 10, 20]);
    assert_eq!(deflection(&curve, 1, 50e-12), [30, 5, -5]);
    assert_eq!(
        curve.distance.as_ref().map(|of| of.source),
        Some(DistanceSource::Ramp)
    );
    assert_eq!(distance(&curve, 0, 1e-9), [0, 100, 200]);
    assert_eq!(distance(&curve, 1, 1e-9), [300, 200, 100]);
    assert_eq!(curve.position, Some([-100.0 * 1e-9, 50.0 * 1e-9]));
    assert_eq!(
        (curve.spring_constant, curve.sensitivity),
        (Some(0.2), Some(50.0 * 1e-9))
    );
    assert!((curve.segments[0].duration.expect("a duration") - 1.5).abs() < 1e-12);
}

#[test]
fn a_bruker_volume_of_version_9_has_8_more_bits() {
    let document = open(samples::bruker_volume());
    assert_eq!(document.curve_count(), 2);
    assert_eq!(document.grid.map(|of| of.shape), Some([2, 1]));
    let curve = curve(&document, 1);
    assert_eq!(deflection(&curve, 0, 50e-12), [1, 300]);
    assert_eq!(curve.pixel, Some(1));
    assert!(
        document.notes.iter().any(|of| of.contains("8 more bits")),
        "{:?}",
        document.notes
    );
    assert_eq!(steps(&document.images[0].values, 1e-9), [1, 2]);
}

#[test]
fn a_bruker_volume_whose_trigger_contradicts_is_refused() {
    let text =
        String::from_utf8_lossy(&samples::bruker_volume()).replace("LSB) 0.02 V", "LSB) 2.00 V");
    let mut bytes = samples::bruker_volume();
    bytes[..4096].copy_from_slice(&text.as_bytes()[..4096]);
    let error = read(bytes).expect_err("refused");
    assert!(
        error.to_string().contains("Trig Threshold Deflection"),
        "{error}"
    );
}

#[test]
fn fields_of_gwyddion_have_title_unit_and_size() {
    let document = open(samples::gwyddion());
    let image = &document.images[0];
    assert_eq!(
        (image.name.as_str(), image.unit.as_str(), image.size),
        ("Potential", "V", Some([1e-6, 2e-6]))
    );
    assert_eq!(image.values, [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(
        document.settings,
        [("/0/meta/Speed".to_owned(), "1 Hz".to_owned())]
    );
    let field = open(samples::gsf());
    assert_eq!(field.images[0].values, [1.5, -2.0]);
    assert_eq!(field.images[0].size, Some([1e-6, 5e-7]));
    let error = read(b"GWYO....".to_vec()).expect_err("the old layout");
    assert!(error.to_string().contains("save it again"), "{error}");
}

#[test]
fn texts_of_curves_are_read() {
    let workshop = curve(&open(samples::workshop(7)), 0);
    assert_eq!(
        (
            workshop.index,
            workshop.spring_constant,
            workshop.sensitivity
        ),
        (7, Some(0.5), Some(5e-8))
    );
    assert_eq!(distance(&workshop, 0, 1e-9), [100, 101, 102]);
    assert_eq!(distance(&workshop, 1, 1e-9), [102, 101]);
    assert_eq!(deflection(&workshop, 1, 1e-9), [15, 10]);
    assert_eq!(
        workshop.position.map(|of| steps(&of, 1e-9)),
        Some(vec![1500, 2500])
    );

    let ntmdt = curve(&open(samples::ntmdt()), 0);
    assert_eq!(distance(&ntmdt, 0, 1e-9), [0, -1, -2]);
    assert_eq!(distance(&ntmdt, 1, 1e-9), [-2, -1, 0]);
    assert!(
        ntmdt
            .notes
            .iter()
            .any(|of| of.contains("in A: the file has no sensitivity")),
        "{:?}",
        ntmdt.notes
    );

    let chiaro = curve(&open(samples::chiaro()), 0);
    assert_eq!(styles(&chiaro), [Style::Approach, Style::Retract]);
    assert_eq!(distance(&chiaro, 0, 1e-9), [100, 200]);
    assert_eq!(deflection(&chiaro, 1, 1e-9), [1]);

    let uff = curve(&open(samples::uff()), 0);
    assert_eq!(distance(&uff, 0, 1e-6), [1, 0]);
    assert_eq!(deflection(&uff, 1, 1e-9), [30, 5]);
}

#[test]
fn thermal_noise_of_jpk_has_its_spectra() {
    let document = open(samples::thermal());
    assert_eq!(document.spectra.len(), 2);
    assert_eq!(document.spectra[1].name, "fit-data");
    assert_eq!(document.spectra[1].unit, "V²/Hz");
    assert_eq!(document.spectra[1].frequency, [0.0, 12.5]);
    assert_eq!(document.spectra[1].values, [2e-3, 2.5e-3]);
    assert_eq!(
        document.settings[0],
        ("sensitivity".to_owned(), "11.0 nm/V".to_owned())
    );
}

#[test]
fn an_image_of_wsxm_spans_its_amplitude() {
    let document = open(samples::wsxm());
    let image = &document.images[0];
    assert_eq!(image.size, Some([1e-6, 500.0 * 1e-9]));
    assert_eq!(steps(&image.values, 1e-9), [6, 4, 2, 0]);
}

#[test]
fn records_of_ardf_are_found_by_their_checksums() {
    let document = open(samples::ardf());
    assert_eq!(document.curve_count(), 2);
    assert_eq!(document.images[0].values, [1.0, 2.0]);
    let curve = curve(&document, 1);
    assert_eq!(styles(&curve), [Style::Approach, Style::Retract]);
    assert_eq!(deflection(&curve, 0, 1.0), [1, 2]);
    assert_eq!((curve.spring_constant, curve.pixel), (Some(2.0), Some(1)));
    assert_eq!(curve.position, Some([5e-7, 0.0]));
}

#[test]
fn hdf5_of_afmformats_is_cut_into_segments_by_its_mode() {
    let document = open(samples::hdf5());
    assert_eq!((document.format, document.curve_count()), (Format::Hdf5, 2));
    let grid = document.grid.expect("a grid");
    assert_eq!(grid.shape, [2, 1]);
    let first = curve(&document, 0);
    assert_eq!(styles(&first), [Style::Approach, Style::Retract]);
    assert_eq!(
        (first.spring_constant, first.sensitivity),
        (Some(0.04), Some(5e-8))
    );
    assert_eq!((first.pixel, first.position), (Some(0), Some([0.0; 2])));
    // Nine points at 1 kHz.
    assert_eq!(first.segments[1].duration, Some(0.009));
    assert_eq!(
        distance(&first, 1, 1e-9),
        [1000, 1188, 1375, 1563, 1750, 1938, 2125, 2313, 2500]
    );
    // What is called a force stays one: 1 nN where it is deepest.
    let force = first.deflection_in(&first.segments[0]).expect("a force");
    assert_eq!((force.unit.as_str(), force.values[14]), ("N", 1e-9));
    let second = curve(&document, 1);
    assert_eq!(
        styles(&second),
        [Style::Approach, Style::Pause, Style::Retract]
    );
    // The grid tells the pixel of a curve that has only its position.
    assert_eq!(
        (second.pixel, second.position),
        (Some(1), Some([2e-6, 0.0]))
    );
    let time = second.segments[2].channel("time").expect("a time");
    assert_eq!(steps(&time.values, 1e-3), [16, 17, 18, 19, 20, 21, 22, 23]);
    assert_eq!(time.unit, "s");
}

#[test]
fn hdf5_of_jpk_has_an_image_for_each_frame() {
    let document = open(samples::hdf5_images());
    let [first, second] = &document.images[..] else {
        panic!("{} images", document.images.len());
    };
    assert_eq!(first.name, "height retrace, frame 0");
    assert_eq!((first.shape, first.size), ([3, 2], Some([3e-6, 2e-6])));
    assert_eq!(first.unit, "m");
    assert_eq!(steps(&first.values, 1e-9), [13, 17, 21, 1, 5, 9]);
    assert_eq!(steps(&second.values, 1e-9), [15, 19, 23, 3, 7, 11]);
}

#[test]
fn files_in_an_archive_are_read_each_by_itself() {
    let files = [
        ("b.csv".to_owned(), samples::workshop(1)),
        ("a.csv".to_owned(), samples::workshop(2)),
        ("readme.txt".to_owned(), b"a text".to_vec()),
        ("image.gsf".to_owned(), samples::gsf()),
    ];
    let document = open(samples::zip(&files));
    assert_eq!(document.format, Format::Zip);
    assert_eq!(document.images.len(), 1);
    let grid = document.grid.expect("a grid, by the positions");
    assert_eq!((grid.shape, document.number_at([1, 0])), ([2, 1], Some(1)));
    let names: Vec<(String, usize)> = document
        .curves()
        .map(|of| of.map(|of| (of.file, of.index)))
        .collect::<Result<_, _>>()
        .expect("curves");
    assert_eq!(names, [("b.csv".to_owned(), 1), ("a.csv".to_owned(), 2)]);
    assert!(
        document.notes.iter().any(|of| of.contains("readme.txt")),
        "{:?}",
        document.notes
    );
}

#[test]
fn a_file_on_the_disk_is_read_as_its_bytes() {
    let archives = samples::archives().into_iter();
    let archives = archives.map(|(name, files)| (name, samples::zip(&files)));
    for (name, bytes) in samples::files().into_iter().chain(archives) {
        let device = std::io::Cursor::new(bytes.clone());
        let of_device = read_from(device, Limits::default());
        let of_device = of_device.unwrap_or_else(|error| panic!("{name}: {error}"));
        let document = open(bytes);
        assert_eq!(of_device.images, document.images, "{name}");
        assert_eq!(of_device.spectra, document.spectra, "{name}");
        assert_eq!(of_device.settings, document.settings, "{name}");
        let curves = of_device.curves().collect::<Result<Vec<_>, _>>();
        assert_eq!(curves, document.curves().collect(), "{name}");
    }
    let folder = afm_files::open(".", Limits::default()).expect_err("a folder");
    assert!(folder.to_string().contains("`.`"), "{folder}");
}

#[test]
fn threads_decode_curves_of_one_document() {
    let document = open(samples::zip(&samples::jpk_map()));
    let expected = curve(&document, 1);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| assert_eq!(curve(&document, 1), expected));
        }
    });
}

#[test]
fn a_deflection_without_sensitivity_says_what_is_missing() {
    let mut files = samples::jpk_force();
    let shared = &mut files[1].1;
    let text =
        String::from_utf8_lossy(shared).replace("distance.defined=true", "distance.defined=false");
    *shared = text.into_bytes();
    let curve = curve(&open(samples::zip(&files)), 0);
    assert_eq!((curve.sensitivity, curve.spring_constant), (None, None));
    let deflection = curve.deflection_in(&curve.segments[0]);
    assert_eq!(deflection.map(|of| of.unit.as_str()), Some("V"));
    let note = "the deflection `vDeflection` is in V: the file has no sensitivity (InvOLS)";
    assert!(curve.notes.iter().any(|of| of == note), "{:?}", curve.notes);
}

#[test]
fn what_is_not_read_is_named() {
    let message = |bytes: &[u8]| read(bytes.to_vec()).expect_err("not read").to_string();
    assert!(message(b"distance,amplitude\n").contains("the text \"distance,amplitu\""));
    assert!(message(b"").contains("the file is empty"));
    let other = samples::hdf5();
    let at = other.windows(10).position(|of| of == b"afmformats");
    let mut other = other.clone();
    other[at.expect("the software")] = b'A';
    assert!(message(&other).contains("an HDF5 file of `Afmformats`"));
    let calibration = [(
        "header.properties".to_owned(),
        b"type=calibration\n".to_vec(),
    )];
    assert!(
        message(&samples::zip(&calibration))
            .contains("a JPK archive `calibration` without force curves")
    );
    let empty = [("notes.txt".to_owned(), b"nothing".to_vec())];
    assert!(message(&samples::zip(&empty)).contains("none of them is a file of an AFM"));
}
