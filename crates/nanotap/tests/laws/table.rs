//! Force tables: motion, derivatives, files, errors.

use std::path::PathBuf;

use nanotap::case::{Case, Key, physical::Catalogue};
use nanotap::study::orbit::{OrbitOptions, OrbitReport, orbit};

use crate::common::{DMT, air};
use crate::derivatives::worst;

/// Rows in nm and nN as a word for `--set`.
fn table(rows: impl IntoIterator<Item = (f64, f64)>) -> String {
    let rows = rows.into_iter().map(|(d, f)| format!("[{d:?}, {f:?}]"));
    let rows: Vec<String> = rows.collect();
    format!(
        "sample.table=[[\"gap (nm)\", \"force (nN)\"], {}]",
        rows.join(", ")
    )
}

fn near(case: &Case, state: &[f64]) -> OrbitReport {
    let options = OrbitOptions {
        period: Some(1),
        state: Some(state.to_vec().into()),
        ..OrbitOptions::default()
    };
    orbit(&case.model().unwrap(), &options).unwrap()
}

/// A spring of 20 N/m below gap 0, which the engine of linear contacts solves exactly.
#[test]
fn two_straight_lines_are_the_linear_contact() {
    for modes in ["modes=1", "modes=3"] {
        let exact = air(20.0, 15.0, &[modes, "sample.stiffness=20 N/m"]);
        let rows = table([(-1.0, 20.0), (0.0, 0.0), (5.0, 0.0)]);
        let rows = air(20.0, 15.0, &[modes, "sample.law=table", &rows]);
        let exact = orbit(&exact.model().unwrap(), &OrbitOptions::default()).unwrap();
        let found = near(&rows, &exact.state);
        let (a, b) = (&found.observables, &exact.observables);
        let size = |[re, im]: [f64; 2]| re.hypot(im);
        for (a, b) in [
            (a.first_harmonic, b.first_harmonic),
            (a.phase, b.phase),
            (a.contact_fraction, b.contact_fraction),
            (a.peak_force, b.peak_force),
            (a.indentation, b.indentation),
            (a.virial, b.virial),
            (size(found.multipliers[0]), size(exact.multipliers[0])),
        ] {
            assert!((a / b - 1.0).abs() < 1e-9, "{modes}: {a} {b}");
        }
        assert_eq!(a.dissipation, 0.0);
        assert!(found.determinant_defect < 1e-9);
    }
}

/// The case of DMT contact with van der Waals attraction (A = 18.52532864 nm, φ = 67.86119340° of the
/// repulsive orbit by scalar Volterra collocation) with its law as rows on either side of a0, evenly in
/// the root of the distance from there, where the law is curved.
fn rows_of_dmt(counts: [i32; 2], more: &[&str]) -> OrbitReport {
    let smooth = air(20.0, 18.0, &DMT);
    let law = smooth.cantilever().unwrap().law.clone().unwrap();
    let law = law.build().unwrap();
    let scales = smooth.physical().unwrap().scales;
    let (length, force) = (1e9 * scales.length, 1e9 * scales.force);
    let a = 18.52532864e-9 / scales.length / smooth.model().unwrap().tip.row[0];
    let (sin, cos) = 67.86119340_f64.to_radians().sin_cos();
    let state = [-a * sin, a * smooth.model().unwrap().frequency() * cos];
    let rows = (-counts[0]..=counts[1]).map(|k| {
        let s = f64::from(k) / f64::from(counts[usize::from(k > 0)]);
        let gap = 0.169 + if k < 0 { -3.0 * s * s } else { 45.0 * s * s };
        let at = gap / length;
        let branch = law.branch_at(at, 0.0);
        (gap, force * law.force(branch, at, 0.0).value)
    });
    let rows = table(rows);
    let words = [
        "sample.law=table",
        "sample.intermolecular_distance=0.169 nm",
        &rows,
    ];
    let found = near(&air(20.0, 18.0, &[&words, more].concat()), &state);
    assert!(found.stable);
    let seen = found.observables.in_si(&scales);
    assert!((seen.contact_fraction - 0.0870649270).abs() < 1e-3);
    found
}

/// A in nm less that of the law.
fn error(found: &OrbitReport) -> f64 {
    let scales = air(20.0, 18.0, &DMT).physical().unwrap().scales;
    1e9 * found.observables.in_si(&scales).first_harmonic - 18.52532864
}

/// The error of a polyline decreases with the square of the spacing of its rows.
#[test]
fn rows_of_a_smooth_law_converge_to_its_orbit() {
    let errors = [60, 120, 240].map(|count| error(&rows_of_dmt([count; 2], &[])));
    for pair in errors.windows(2) {
        assert!((3.5..4.5).contains(&(pair[0] / pair[1])), "{errors:?}");
    }
    assert!(errors[2].abs() < 1e-4, "{errors:?}");
}

/// A spline through as many rows is nearer by far; a thousand rows give the law to six digits.
#[test]
fn a_spline_is_nearer_to_the_law() {
    let straight = error(&rows_of_dmt([60; 2], &[]));
    for by in ["monotone", "natural"] {
        let word = format!("sample.interpolation={by}");
        let few = error(&rows_of_dmt([60; 2], &[&word]));
        assert!(
            few.abs() < 0.1 * straight.abs(),
            "{by}: {few:e} {straight:e}"
        );
        let many = error(&rows_of_dmt([300, 700], &[&word]));
        assert!(many.abs() < 1e-6, "{by}: {many:e}");
    }
}

/// A column of damping does what exponential damping does, and its rows are read in their unit.
#[test]
fn a_table_has_a_column_of_damping() {
    let force = |gap: f64| {
        if gap < 0.0 {
            gap * gap - 5.0 * gap
        } else {
            0.0
        }
    };
    let rows = |damping: bool| {
        let rows = (0..1000).map(|k| {
            let gap = -2.5 + 0.04 * f64::from(k);
            let column = format!(", {:?}", 2e3 * (-gap / 0.8).exp());
            let column = if damping { &*column } else { "" };
            format!("[{gap:?}, {:?}{column}]", force(gap))
        });
        let header = if damping {
            ", \"damping (pN s/m)\""
        } else {
            ""
        };
        let rows: Vec<String> = rows.collect();
        format!(
            "sample.table=[[\"gap (nm)\", \"force (nN)\"{header}], {}]",
            rows.join(", ")
        )
    };
    let natural = "sample.interpolation=natural";
    let law = [
        "sample.law=table + exponential-damping",
        "sample.damping=2e-9 N s/m",
        "sample.decay_length=0.8 nm",
        natural,
        &rows(false),
    ];
    let column = ["sample.law=table", natural, &rows(true)];
    let [law, column] = [&law[..], &column].map(|words| air(20.0, 15.0, words));
    let expected = orbit(&law.model().unwrap(), &OrbitOptions::default()).unwrap();
    let found = near(&column, &expected.state);
    assert!(found.stable && found.determinant_defect < 1e-9);
    let (a, b) = (&found.observables, &expected.observables);
    for (a, b) in [
        (a.first_harmonic, b.first_harmonic),
        (a.phase, b.phase),
        (a.dissipation, b.dissipation),
        (a.peak_force, b.peak_force),
    ] {
        assert!((a / b - 1.0).abs() < 1e-6, "{a} {b}");
    }
    assert!(a.dissipation > 0.0);
    // What was read is written.
    let again = nanotap::case::file::Source {
        name: "again.toml".into(),
        text: column.to_toml(),
    };
    let again = Case::parse(Some(again), &[]).unwrap();
    assert_eq!(again.cantilever().unwrap(), column.cantilever().unwrap());
}

#[test]
fn derivatives_by_the_factors_of_a_table_and_by_the_lever() {
    let rows = table([
        (-2.0, 9.0),
        (-0.5, 1.0),
        (0.0, -1.0),
        (0.7, -0.8),
        (6.0, 0.0),
    ]);
    let case = air(20.0, 10.0, &["modes=2", "sample.law=table", &rows]);
    let scale = 1e-9 / case.physical().unwrap().scales.length;
    let omega = case.model().unwrap().frequency();
    let state = [-3.0, 0.1, 7.0 * omega, 0.5 * omega].map(|x| x * scale);
    let keys = [
        Key::SampleForceFactor,
        Key::SampleGapFactor,
        Key::GapTip,
        Key::LeverK,
        Key::DriveFrequency,
    ];
    let off = worst(&case, &keys, &state);
    assert!(off < 1e-6, "{off}");
    let rows = "sample.table=[[\"gap (nm)\", \"force (nN)\", \"damping (uN s/m)\"], [-2, 9, 0.05], \
        [-0.5, 1, 0.04], [0, -1, 0.02], [0.7, -0.8, 0.01], [6, 0, 0]]";
    let words = [
        "modes=2",
        "sample.law=table",
        "sample.interpolation=natural",
        rows,
    ];
    let case = air(20.0, 10.0, &words);
    let keys = [&keys[..], &[Key::SampleDampingFactor]].concat();
    let off = worst(&case, &keys, &state);
    assert!(off < 1e-6, "{off}");
}

/// A folder for one test.
fn folder(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("nanotap-table-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&path).unwrap();
    path
}

const LEVER: &str = "[cantilever]\nk = \"1 N/m\"\nf0 = \"100 kHz\"\nQ = 200\n\
    [drive]\nfrequency = \"100 kHz\"\nfree_amplitude = \"20 nm\"\n[gap]\ntip = \"18 nm\"\n";

fn loaded(path: &std::path::Path, words: &[&str]) -> Result<Case, String> {
    let words: Vec<String> = words.iter().map(|&w| w.to_owned()).collect();
    Case::load(Some(path), &words, &Catalogue::shared()).map_err(|error| error.to_string())
}

#[test]
fn a_table_is_read_once_relative_to_its_case_file() {
    let folder = folder("read");
    let (case, curve) = (folder.join("lever.toml"), folder.join("curve.csv"));
    let text = format!("[sample]\nlaw = \"table\"\ntable = \"curve.csv\"\n{LEVER}");
    std::fs::write(&case, &text).unwrap();
    // From large to small distances, in other units.
    let rows = "# measured\ndistance [nm]; force [pN]\n5;0\n0;-500\n-1;4000\n";
    std::fs::write(&curve, rows).unwrap();
    let read = loaded(&case, &[]).unwrap();
    let points = |case: &Case| {
        let force = case.physical().unwrap().sample.force.clone().unwrap();
        force.table.unwrap().rows().points().to_vec()
    };
    let expected = [(-1e-9, 4e-9), (0.0, -0.5e-9), (5e-9, 0.0)];
    for (found, expected) in points(&read).iter().zip(expected) {
        assert!((found.0 - expected.0).abs() < 1e-24 && (found.1 - expected.1).abs() < 1e-24);
    }
    // A path in `--set` is relative to the folder of the command.
    let word = format!("sample.table={}", curve.display());
    assert_eq!(points(&loaded(&case, &[&word]).unwrap()), points(&read));
    // A written case contains the rows themselves.
    std::fs::write(&case, read.to_toml()).unwrap();
    std::fs::remove_file(&curve).unwrap();
    assert_eq!(points(&loaded(&case, &[]).unwrap()), points(&read));
    // A text alone does not open files.
    let source = nanotap::case::file::Source {
        name: "lever.toml".into(),
        text,
    };
    let said = Case::parse(Some(source), &[]).unwrap_err().to_string();
    assert!(said.contains("is not opened here"), "{said}");
    let said = loaded(&folder.join("lever.toml"), &[&word]).unwrap_err();
    assert!(said.contains("curve.csv"), "{said}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn tables_that_are_not_functions_are_refused_with_their_place() {
    let folder = folder("refused");
    let (case, curve) = (folder.join("lever.toml"), folder.join("curve.csv"));
    let text = format!("[sample]\nlaw = \"table\"\ntable = \"curve.csv\"\n{LEVER}");
    std::fs::write(&case, text).unwrap();
    let refused = |rows: &str, words: &[&str]| {
        std::fs::write(&curve, rows).unwrap();
        let said = loaded(&case, &[]).unwrap_err();
        for word in words.iter().chain(&["lever.toml:3:9", "curve.csv"]) {
            assert!(said.contains(word), "{word} is not in: {said}");
        }
    };
    let rows = |rows: &str| format!("gap (nm),force (nN)\n{rows}");
    refused(&rows("1,0\n"), &["at least two rows"]);
    refused(&rows("0,1\n1,0\n0.5,0\n"), &["row 3", "turns back"]);
    refused(&rows("0,1\n1,0.5\n1,0\n"), &["row 3", "would jump"]);
    refused(&rows("0,1\n1,nan\n"), &["line 3", "missing number"]);
    refused(&rows("0,1\n1,inf\n"), &["row 2", "not finite"]);
    refused(
        &rows("0,1\n1,x\n"),
        &["line 3", "column 2", "`x` is not a number"],
    );
    refused(&rows("0,1\n1\n"), &["line 3", "1 fields"]);
    refused("gap,force (nN)\n0,1\n1,0\n", &["`gap`", "unit"]);
    refused("gap (nN),force (nN)\n0,1\n1,0\n", &["gap (nN)"]);
    refused("gap (nm),phase (deg)\n0,1\n1,0\n", &["no column `force`"]);
    refused(
        "gap (nm),d (nm),force (nN)\n0,0,1\n1,1,0\n",
        &["more than one"],
    );
    let many: Vec<String> = (0..5000).map(|k| format!("{k},0\n")).collect();
    refused(&rows(&many.concat()), &["5000", "4095"]);
    std::fs::remove_file(&curve).unwrap();
    let said = loaded(&case, &[]).unwrap_err();
    assert!(said.contains("no such file"), "{said}");
    std::fs::remove_dir_all(&folder).unwrap();

    let said = |words: &[&str]| {
        let source = nanotap::case::file::Source {
            name: "lever.toml".into(),
            text: LEVER.into(),
        };
        let words: Vec<String> = words.iter().map(|&w| w.to_owned()).collect();
        Case::parse(Some(source), &words).unwrap_err().to_string()
    };
    let rows = table([(-1.0, 2.0), (0.0, 0.0)]);
    assert!(said(&["sample.law=table"]).contains("needs a force curve"));
    assert!(
        said(&[
            &rows,
            "sample.law=table + hertz",
            "sample.modulus=1 GPa",
            "tip.radius=5 nm"
        ])
        .contains("counted twice")
    );
    assert!(
        said(&[
            &rows,
            "sample.law=hertz",
            "sample.modulus=1 GPa",
            "tip.radius=5 nm"
        ])
        .contains("not a parameter of")
    );
    assert!(said(&["sample.law=table", "sample.table=[1, 2]"]).contains("an array"));
    assert!(said(&["sample.law=table", "sample.table=3"]).contains("not opened"));
    let law = "sample.law=table";
    let negative =
        "sample.table=[[\"gap (nm)\", \"force (nN)\", \"damping (N s/m)\"], [0, 1, 0], [1, 0, -1]]";
    assert!(said(&[law, negative]).contains("the damping is negative"));
    assert!(said(&[law, &rows, "sample.damping_factor=2"]).contains("no column of damping"));
    assert!(said(&[law, &rows, "sample.interpolation=cubic"]).contains("monotone"));
    let hertz = [
        "sample.law=hertz",
        "sample.modulus=1 GPa",
        "tip.radius=5 nm",
    ];
    let said = said(&[&hertz[..], &["sample.interpolation=natural"]].concat());
    assert!(said.contains("not a parameter of"), "{said}");
}

/// A table may be combined with a rate-dependent law.
#[test]
fn a_table_may_be_damped() {
    let rows = table([(-1.0, 20.0), (0.0, 0.0), (5.0, 0.0)]);
    let words = [
        &rows,
        "sample.law=table + exponential-damping",
        "sample.damping=1e-9 N s/m",
        "sample.decay_length=0.5 nm",
    ];
    let model = air(20.0, 15.0, &words).model().unwrap();
    let found = orbit(&model, &OrbitOptions::default()).unwrap();
    assert!(found.stable && found.observables.dissipation > 0.0);
    assert!(found.determinant_defect < 1e-9);
}

/// A reconstructed force has damping below zero where it is no more than its error.
#[test]
fn uncertain_damping_below_zero_counts_as_none() {
    let curve = folder("uncertain").join("curve.csv");
    std::fs::write(
        &curve,
        "distance (nm),force (nN),damping (N s/m),damping error (N s/m)\n\
         0,1,1e-8,1e-9\n1,0,-1e-9,2e-9\n",
    )
    .unwrap();
    let case = curve.with_file_name("lever.toml");
    let text = format!("[sample]\nlaw = \"table\"\ntable = \"curve.csv\"\n{LEVER}");
    std::fs::write(&case, text).unwrap();
    let certain = "sample.table=[[\"gap (nm)\", \"force (nN)\", \"damping (N s/m)\"], \
                   [0, 1, 1e-8], [1, 0, 0]]";
    let [read, stated] = [&[][..], &[certain]].map(|words| loaded(&case, words).unwrap());
    let laws = [read, stated].map(|case| case.cantilever().unwrap().law.clone());
    assert_eq!(laws[0], laws[1]);
    std::fs::remove_dir_all(curve.parent().unwrap()).unwrap();
}
